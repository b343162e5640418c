// The first bins of every pixel as its core, sorted, over the tail of the others (renderer/techniques/kbuffer_deep.py).

import type { Work } from "../work";
import type { Allocation } from "./allocation";
import { type Binned, TAIL_FILES, tailBuffers, tailTargets } from "./bins";
import type { Frame } from "./frame";

const CAPTURE = {
  files: [...TAIL_FILES, "capture_core"],
  entryPoint: "capture_core",
  writes: [false, false, false, false, true, true],
};
const FRAGMENT_WORDS = 2;

/**
 * Renders with given cuts.
 *
 * @param placed Its cuts and offsets are read.
 * @param fragments Of all cores at most: the budget.
 * @param shown [P], gets the picture.
 */
export async function renderCore(
  frame: Frame,
  work: Work,
  binned: Binned,
  placed: Allocation,
  fragments: number,
  shown: GPUBuffer,
): Promise<void> {
  const { offsets, cuts } = placed;
  const cursors = frame.zeros(work, "cursors", frame.pixels);
  const pool = frame.room("pool", FRAGMENT_WORDS * Math.max(fragments, 1)); // a binding holds one at least
  const targets = tailTargets(frame);
  const buffers = [...tailBuffers(frame, binned), offsets, cuts, cursors, pool];
  await frame.geometry.drawTransparent(work, { ...CAPTURE, tail: binned.tail }, frame.depth, buffers, targets);
  frame.forPixels(work, ["slot", "sort"], "sort_runs", [offsets, cursors, pool]);
  const textures = [frame.background, ...targets].map((texture) => texture.createView());
  frame.forPixels(work, ["display", "resolve_core"], "resolve_core", [offsets, cursors, pool, ...textures, shown]);
}
