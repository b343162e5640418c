// The k(p) nearest fragments of every pixel by the two-pass chain, the tail, and the resolve
// (renderer/techniques/chain.py).

import type { Work } from "../work";
import type { Frame } from "./frame";
import type { Pass } from "./geometry";
import type { Sums } from "./sums";

const DEPTHS: Pass = { files: ["chain_depth"], entryPoint: "chain_depth", writes: [false, true] };
const COLOURS: Pass = {
  files: ["statistics", "depth_bins", "chain_colour"],
  entryPoint: "chain_colour",
  writes: [false, false, true, false, false],
};
const RESOLVE = ["statistics", "display", "resolve_chain"];

/**
 * Renders with given slots.
 *
 * @param offsets [P + 1], where the runs of slots begin.
 * @param slots Of all pixels: the budget.
 * @param sums Of this view: what the tail reads.
 * @param shown [P], gets the picture.
 */
export async function renderChain(
  frame: Frame,
  work: Work,
  offsets: GPUBuffer,
  slots: number,
  sums: Sums,
  shown: GPUBuffer,
): Promise<void> {
  const { geometry, depth, statistics, background } = frame;
  const { tail, gathered } = sums;
  const depths = frame.zeros(work, "depths", slots);
  const colours = frame.zeros(work, "colours", slots);
  await geometry.drawTransparent(work, DEPTHS, depth, [offsets, depths]);
  const rest = frame.target("tail", frame.gpu.sumFormat);
  const read = [offsets, depths, colours, statistics, gathered];
  await geometry.drawTransparent(work, { ...COLOURS, tail }, depth, read, [rest]);
  const resources = [offsets, colours, statistics, gathered, background.createView(), rest.createView(), shown];
  frame.forPixels(work, RESOLVE, "resolve_chain", resources, { tail });
}
