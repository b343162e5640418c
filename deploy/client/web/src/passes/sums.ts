// The gather pass and the packed depth bins: what the tail reads, and with `all` what a network reads.

import { gatheredWords, keptWords } from "../shaders";
import type { Frame } from "./frame";
import type { Pass } from "./geometry";

const FILES = ["statistics", "depth_bins", "gather"];
const SUMS = 4;
const HALF: GPUTextureFormat = "rgba16float";
const BINS_ONLY: Pass = { files: FILES, entryPoint: "gather_bins", writes: [false, true], targets: [] };
const ALL: Pass = {
  files: FILES,
  entryPoint: "gather_all",
  writes: [false, true],
  targets: Array.from({ length: SUMS }, () => HALF),
};

export interface Sums {
  readonly bins: number;
  /** What the gather pass counts in words (gather.wgsl). */
  readonly gathered: GPUBuffer;
  /** Optical depth and depth bins, packed (depth_bins.wgsl). */
  readonly kept: GPUBuffer;
  /** What it blends; empty if nobody asked for it. */
  readonly targets: readonly GPUTexture[];
}

/** Gathers what is to be known of every pixel's fragments. */
export function gather(frame: Frame, encoder: GPUCommandEncoder, bins: number, all: boolean): Sums {
  const gathered = frame.zeros(encoder, "gathered", gatheredWords(bins) * frame.pixels);
  const kept = frame.words("kept", keptWords(bins) * frame.pixels);
  const targets = all ? Array.from({ length: SUMS }, (_, i) => frame.target(`sums${i}`, HALF)) : [];
  const buffers = [frame.statistics, gathered];
  frame.geometry.drawTransparent(encoder, all ? ALL : BINS_ONLY, bins, frame.depth, buffers, targets);
  frame.forPixels(encoder, ["depth_bins", "pack"], "pack_bins", [gathered, kept], { bins });
  return { bins, gathered, kept, targets };
}
