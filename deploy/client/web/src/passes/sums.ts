// The gather pass and the packed depth bins: what the tail reads, and with `all` what a network reads.

import { gatheredWords } from "../shaders";
import type { Tail } from "../tail";
import type { Work } from "../work";
import type { Frame } from "./frame";
import type { Pass } from "./geometry";

const FILES = ["statistics", "depth_bins", "gather"];
const TARGETS = 4;
const WRITES = [false, true];
const TAIL_ONLY: Pass = { files: FILES, entryPoint: "gather_tail", writes: WRITES };
const ALL: Pass = { files: FILES, entryPoint: "gather_all", writes: WRITES };

export interface Sums {
  readonly tail: Tail;
  /** What is gathered in words, its depth bins packed (depth_bins.wgsl). */
  readonly gathered: GPUBuffer;
  /** What is blended; empty if nobody asked for it. */
  readonly targets: readonly GPUTexture[];
}

/** Gathers what is to be known of every pixel's fragments. */
export async function gather(frame: Frame, work: Work, tail: Tail, all: boolean): Promise<Sums> {
  const gathered = frame.zeros(work, "gathered", gatheredWords(tail.bins) * frame.pixels);
  const format = formatFor(frame, tail);
  const targets = all ? Array.from({ length: TARGETS }, (_, i) => frame.target(`sums${i}`, format)) : [];
  const buffers = [frame.statistics, gathered];
  await frame.geometry.drawTransparent(work, { ...(all ? ALL : TAIL_ONLY), tail }, frame.depth, buffers, targets);
  frame.forPixels(work, ["depth_bins", "pack"], "pack_bins", [gathered], { tail });
  return { tail, gathered, targets };
}

/** Of what a network reads. A plain tail shows every slot that a rounding has moved: it gets float32, where there is. */
function formatFor(frame: Frame, tail: Tail): GPUTextureFormat {
  return tail.bins === 0 && frame.gpu.blendsManyFloat32 ? "rgba32float" : "rgba16float";
}
