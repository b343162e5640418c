// The k nearest fragments of every pixel by the two-pass chain, the tail, and the resolve
// (renderer/techniques/chain.py).

import type { Work } from "../work";
import { type Binned, TAIL_FILES, tailBuffers, tailTargets } from "./bins";
import type { Frame } from "./frame";
import type { Pass } from "./geometry";

const DEPTHS: Pass = { files: ["chain_depth"], entryPoint: "chain_depth", writes: [false, true] };
const COLOURS: Pass = {
  files: [...TAIL_FILES, "chain_colour"],
  entryPoint: "chain_colour",
  writes: [false, false, false, false, true],
};

/**
 * Renders with given slots.
 *
 * @param offsets [P + 1], where the runs of slots begin.
 * @param slots Of all pixels: the budget.
 * @param binned Of this view: what the tail reads.
 * @param shown [P], gets the picture.
 */
export async function renderChain(
  frame: Frame,
  work: Work,
  offsets: GPUBuffer,
  slots: number,
  binned: Binned,
  shown: GPUBuffer,
): Promise<void> {
  const { geometry, depth } = frame;
  const depths = frame.zeros(work, "depths", slots);
  const colours = frame.zeros(work, "colours", slots);
  await geometry.drawTransparent(work, DEPTHS, depth, [offsets, depths]);
  const targets = tailTargets(frame);
  const read = [...tailBuffers(frame, binned), offsets, depths, colours];
  await geometry.drawTransparent(work, { ...COLOURS, tail: binned.tail }, depth, read, targets);
  const textures = [frame.background, ...targets].map((texture) => texture.createView());
  frame.forPixels(work, ["display", "resolve_chain"], "resolve_chain", [offsets, colours, ...textures, shown]);
}
