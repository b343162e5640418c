// Where each pixel's run of slots begins: whole bins at the one price that uses a budget (renderer/allocation/gpu.py),
// every fragment, or the same number everywhere.

import { CONSTANTS } from "../generated";
import { BLOCK, CEILING, shader } from "../shaders";
import type { Tail } from "../tail";
import type { Work } from "../work";
import type { Binned } from "./bins";
import type { Store } from "./store";

/** Members of `Cuts` in cut_state.wgsl. */
const CUT_WORDS = 4;
const RANKS = Number(CONSTANTS["RANKS"]);
/** What selects cuts. */
const CUT_FILES = ["cut_state", "bin_words", "cuts_of_counts"];

/** Blocks of the pixels and of the offset behind the last one. */
export const blocksOf = (pixels: number): number => Math.floor(pixels / BLOCK) + 1;

/** Slots that a technique may use: `factor` a pixel, within what sums hold. */
export function budgetOf(factor: number, pixels: number): number {
  return Math.min(Math.floor(factor * pixels), CEILING - 1);
}

export class Allocation {
  readonly #store: Store;
  readonly #blocks: number;
  readonly #budget: GPUBuffer;

  constructor(store: Store) {
    this.#store = store;
    this.#blocks = blocksOf(store.pixels);
    this.#budget = store.gpu.filled(new Uint32Array(4), GPUBufferUsage.UNIFORM);
  }

  /** Where each pixel's run of slots begins, and the end of the last one. */
  get offsets(): GPUBuffer {
    return this.#store.words("offsets", this.#store.pixels + 1);
  }

  /** Bins of each pixel's core. */
  get cuts(): GPUBuffer {
    return this.#store.words("cuts", this.#store.pixels);
  }

  /** What a predictor is told of the selection. */
  get state(): GPUBuffer {
    return this.#store.words("cut state", CUT_WORDS);
  }

  get #sums(): GPUBuffer {
    return this.#store.words("sums", 2 * this.#blocks);
  }

  /** N, pixels with fragments, and fragments of the fullest one, read back. `counts`, [P], are n(p). */
  async totals(work: Work, counts: GPUBuffer): Promise<readonly [fragments: number, occupied: number, deepest: number]> {
    const found = this.#store.words("counted", 3);
    const blocks = this.#total(work, counts);
    this.#run(work, ["join"], "join", [blocks, found], 1);
    work.submit();
    const [fragments, occupied, deepest] = await this.#store.gpu.read(found);
    return [fragments!, occupied!, deepest!];
  }

  /** A slot for every fragment. */
  placeAll(work: Work, counts: GPUBuffer): void {
    this.#total(work, counts);
    this.#run(work, ["scan"], "scan", [this.#store.words("total", 1), this.#sums], 1);
    this.#run(work, ["place_all"], "place_all", [counts, this.#sums, this.offsets], this.#blocks);
  }

  /** The same number of slots for every pixel of the window. The work has to be submitted before the next budget. */
  placeFixed(work: Work, budget: number): void {
    this.#setBudget(budget);
    this.#store.forPixels(work, ["fixed"], "place_fixed", [this.offsets, this.#budget], {
      threads: this.#store.pixels + 1,
    });
  }

  /** Finds how many fragments can be in a core, and whether a budget covers them; as `placeFixed`. */
  begin(work: Work, { tail, words }: Binned, budget: number): void {
    this.#setBudget(budget);
    work.encoder.clearBuffer(this.state);
    this.#run(work, [...CUT_FILES, "core_totals"], "total_cores", [words, this.state], this.#blocks, tail);
    this.#run(work, ["cut_state", "begin_cuts"], "begin_cuts", [this.state, this.#budget], 1, tail);
  }

  /** Selects the rank that uses the budget, and lays out the pool. */
  place(work: Work, { tail, words }: Binned): void {
    const counted = this.#store.zeros(work, "prices", RANKS);
    const [state, cuts, sums] = [this.state, this.cuts, this.#sums];
    this.#run(work, [...CUT_FILES, "count_prices"], "count_prices", [words, state, counted], this.#blocks, tail);
    this.#run(work, ["cut_state", "choose"], "choose", [state, counted, this.#budget], 1, tail);
    this.#run(work, [...CUT_FILES, "find_cuts"], "find_cuts", [words, state, cuts, sums], this.#blocks, tail);
    this.#run(work, ["scan"], "scan", [state, sums], 1);
    const placed = [state, cuts, sums, this.offsets, this.#budget, words];
    this.#run(work, [...CUT_FILES, "place_cuts"], "place_cuts", placed, this.#blocks, tail);
  }

  destroy(): void {
    this.#budget.destroy();
  }

  #setBudget(budget: number): void {
    this.#store.gpu.device.queue.writeBuffer(this.#budget, 0, new Uint32Array([Math.min(budget, CEILING - 1)]));
  }

  #total(work: Work, counts: GPUBuffer): GPUBuffer {
    const blocks = this.#store.words("totals", 4 * this.#blocks);
    this.#run(work, ["totals"], "total_blocks", [counts, blocks, this.#sums], this.#blocks);
    return blocks;
  }

  #run(
    work: Work,
    files: readonly string[],
    entryPoint: string,
    buffers: readonly GPUBuffer[],
    groups: number,
    tail?: Tail,
  ): void {
    this.#store.dispatch(work, shader(files, tail), entryPoint, buffers, [groups, 1]);
  }
}
