// `sbuffer`, exact: every fragment in contiguous per-pixel runs, sorted, composited (renderer/techniques/sbuffer.py).

import type { Work } from "../work";
import type { Frame } from "./frame";
import type { Pass } from "./geometry";

const CAPTURE: Pass = { files: ["capture"], entryPoint: "capture", writes: [false, true, true] };
const FRAGMENT_WORDS = 2;

/**
 * Renders all fragments.
 *
 * @param offsets [P + 1], prefix sums of n.
 * @param fragments N.
 * @param shown [P], gets the picture.
 */
export async function renderExact(
  frame: Frame,
  work: Work,
  offsets: GPUBuffer,
  fragments: number,
  shown: GPUBuffer,
): Promise<void> {
  const cursors = frame.zeros(work, "cursors", frame.pixels);
  const pool = frame.room("pool", FRAGMENT_WORDS * Math.max(fragments, 1)); // a binding holds one at least
  await frame.geometry.drawTransparent(work, CAPTURE, frame.depth, [offsets, cursors, pool]);
  frame.forPixels(work, ["slot", "sort"], "sort_runs", [offsets, cursors, pool]);
  const read = [offsets, pool, frame.background.createView(), shown];
  frame.forPixels(work, ["display", "resolve_exact"], "resolve_exact", read);
}
