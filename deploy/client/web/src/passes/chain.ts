// The k(p) nearest fragments of every pixel by the two-pass chain, the tail, and the resolve
// (renderer/techniques/chain.py).

import type { Frame } from "./frame";
import type { Pass } from "./geometry";
import type { Sums } from "./sums";

const DEPTHS: Pass = { files: ["chain_depth"], entryPoint: "chain_depth", writes: [false, true], targets: [] };
const COLOURS = ["statistics", "depth_bins", "chain_colour"];

/**
 * Renders with given slots.
 *
 * @param offsets [P + 1], where the runs of slots begin.
 * @param slots Of all pixels: the budget.
 * @param sums Of this view: what the tail reads.
 * @param shown [P], gets the picture.
 */
export function renderChain(
  frame: Frame,
  encoder: GPUCommandEncoder,
  offsets: GPUBuffer,
  slots: number,
  sums: Sums,
  shown: GPUBuffer,
): void {
  const { geometry, depth, statistics, background } = frame;
  const depths = frame.zeros(encoder, "depths", slots);
  const colours = frame.zeros(encoder, "colours", slots);
  geometry.drawTransparent(encoder, DEPTHS, sums.bins, depth, [offsets, depths]);
  const format = frame.gpu.sumFormat;
  const tail = frame.target("tail", format);
  const second: Pass = {
    files: COLOURS,
    entryPoint: "chain_colour",
    writes: [false, false, true, false, false],
    targets: [format],
  };
  geometry.drawTransparent(
    encoder,
    second,
    sums.bins,
    depth,
    [offsets, depths, colours, statistics, sums.kept],
    [tail],
  );
  const read = [offsets, colours, sums.kept, background.createView(), tail.createView(), shown];
  frame.forPixels(encoder, ["depth_bins", "display", "resolve_chain"], "resolve_chain", read, { bins: sums.bins });
}
