// Depth bins of every pixel, packed: what a tail reads, and with `all` what a network reads beside them
// (renderer/bin_pass.py).

import type { Tail } from "../tail";
import type { Work } from "../work";
import type { Frame } from "./frame";
import type { Pass } from "./geometry";

const FILES = ["bins", "gather_bins"];
const TAIL_ONLY: Pass = { files: FILES, entryPoint: "gather_tail", writes: [false, true] };
const ALL: Pass = { files: FILES, entryPoint: "gather_all", writes: [false, true, true] };

/** Files of the shaders that weigh fragments of a tail. Their first storage bindings are `tailBuffers`. */
export const TAIL_FILES = ["bins", "tail_inputs", "kept_bins", "tail"];

export interface Binned {
  readonly tail: Tail;
  /** [P][BINS], packed (kept_bins.wgsl). */
  readonly bins: GPUBuffer;
  /** [P][BINS / 4], fragments of each bin, 8 bits each; nothing if nobody asked for them. */
  readonly counts: GPUBuffer;
  /** Sums of colours; empty if nobody asked for them. */
  readonly colours: readonly GPUTexture[];
}

/** What `TAIL_FILES` read. */
export const tailBuffers = (frame: Frame, { bins }: Binned): GPUBuffer[] => [frame.ranges, bins];

/** What a tail's sums are blended into: weighted colour and weight, optical depth. */
export const tailTargets = (frame: Frame): GPUTexture[] => [
  frame.target("tail", frame.gpu.sumFormat),
  frame.target("optical depth", frame.gpu.scalarFormat),
];

/** Gathers what is to be known of every pixel's fragments. */
export async function gatherBins(frame: Frame, work: Work, tail: Tail, all: boolean): Promise<Binned> {
  // Of exactly the size: shaders ask a buffer how many pixels there are.
  const bins = frame.zeros(work, `${tail.bins} bins`, tail.bins * frame.pixels);
  const counts = all ? frame.zeros(work, `${tail.bins} counts`, (tail.bins / 4) * frame.pixels) : frame.words("none", 1);
  const colours = all ? [frame.target("colours", "rgba16float"), frame.target("squares", "rgba16float")] : [];
  const buffers = [frame.ranges, bins, ...(all ? [counts] : [])];
  await frame.geometry.drawTransparent(work, { ...(all ? ALL : TAIL_ONLY), tail }, frame.depth, buffers, colours);
  frame.forPixels(work, ["pack"], "pack_bins", [bins], { tail });
  return { tail, bins, counts, colours };
}
