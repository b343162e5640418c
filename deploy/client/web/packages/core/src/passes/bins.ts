// Depth bins of every pixel, packed: what a tail reads, and the fragments of each; with `all` what a network reads beside
// them (renderer/bin_pass.py).

import type { Tail } from "../tail";
import type { Work } from "../work";
import type { Frame } from "./frame";
import type { Pass } from "./geometry";
import type { Store } from "./store";

const FILES = ["bins", "bin_words", "add_to_bins", "gather_bins"];
const TAIL_ONLY: Pass = { files: FILES, entryPoint: "gather_tail", writes: [false, true] };
const ALL: Pass = { files: FILES, entryPoint: "gather_all", writes: [false, true, true] };

/** Files of the shaders that weigh fragments of a tail. Their first storage bindings are `tailBuffers`. */
export const TAIL_FILES = ["bins", "tail_inputs", "kept_bins", "in_front", "tail"];

export interface Binned {
  readonly tail: Tail;
  /** [P][BINS], packed (bin_words.wgsl). */
  readonly words: GPUBuffer;
  /** [P], sums of luma and of its square; null if nobody asked for them. */
  readonly luma: GPUBuffer | null;
}

/** What `TAIL_FILES` read. */
export const tailBuffers = (frame: Frame, { words }: Binned): GPUBuffer[] => [frame.ranges, words];

/** What a tail's sums are blended into: weighted colour and weight, optical depth. */
export const tailTargets = (frame: Frame): GPUTexture[] => [
  frame.target("tail", "rgba16float"),
  frame.target("optical depth", frame.gpu.scalarFormat),
];

/** Gathers what is to be known of every pixel's fragments. */
export async function gatherBins(frame: Frame, work: Work, tail: Tail, all: boolean): Promise<Binned> {
  // Of exactly the size: shaders ask a buffer how many pixels there are.
  const words = frame.zeros(work, `${tail.bins} bins`, tail.bins * frame.pixels);
  const luma = all ? frame.zeros(work, "luma", frame.pixels) : null;
  const buffers = [frame.ranges, words, ...(luma ? [luma] : [])];
  await frame.geometry.drawTransparent(work, { ...(all ? ALL : TAIL_ONLY), tail }, frame.depth, buffers);
  packBins(frame, work, tail, words);
  return { tail, words, luma };
}

/** Puts what is kept of gathered bins, and the fragments of each, in their place. */
export function packBins(store: Store, work: Work, tail: Tail, words: GPUBuffer): void {
  store.forPixels(work, ["bin_words", "pack"], "pack_bins", [words], { tail });
}
