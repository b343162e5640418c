// Slots of every pixel (renderer/allocation/gpu.py): of predicted gain curves at the one price that uses a
// budget, looked for around the last frame's; of a budget for everything, each pixel's n; or the same number everywhere.

import { BLOCK, CEILING, EDGES, ROUNDS, shader } from "../shaders";
import type { Work } from "../work";
import type { Frame } from "./frame";

/** Members of `State` in state.wgsl. */
export const STATE_WORDS = 10 + EDGES;

/** Blocks of the pixels and of the offset behind the last one. */
export const blocksOf = (pixels: number): number => Math.floor(pixels / BLOCK) + 1;

/** Slots that a technique may use: `factor` a pixel, at most N, within what sums hold. */
export function budgetOf(factor: number, pixels: number): number {
  return Math.min(Math.floor(factor * pixels), CEILING - 1);
}

export class Allocation {
  readonly #frame: Frame;
  readonly #blocks: number;
  readonly #budget: GPUBuffer;

  constructor(frame: Frame) {
    this.#frame = frame;
    this.#blocks = blocksOf(frame.pixels);
    this.#budget = frame.gpu.filled(new Uint32Array(4), GPUBufferUsage.UNIFORM);
  }

  /** What was found; the next search begins there. */
  get state(): GPUBuffer {
    return this.#frame.words("state", STATE_WORDS);
  }

  /** N, pixels with fragments, and fragments of the fullest one; read back. */
  async totals(): Promise<readonly [fragments: number, occupied: number, deepest: number]> {
    const [fragments, occupied, deepest] = await this.#frame.gpu.read(this.state);
    return [fragments!, occupied!, deepest!];
  }

  /** Where each pixel's run of slots begins, and the end of the last one. */
  get offsets(): GPUBuffer {
    return this.#frame.words("offsets", this.#frame.pixels + 1);
  }

  /** Of a predictor: a and 1 / b of every pixel. */
  get curves(): GPUBuffer {
    return this.#frame.words("curves", 2 * this.#frame.pixels);
  }

  get #totals(): GPUBuffer {
    return this.#frame.words("totals", 4 * this.#blocks);
  }

  get #sums(): GPUBuffer {
    return this.#frame.words("sums", 2 * this.#blocks);
  }

  get #slots(): GPUBuffer {
    return this.#frame.words("slots", this.#frame.pixels);
  }

  /** Totals of what was counted; once a view. */
  count(work: Work): void {
    const { statistics } = this.#frame;
    this.#run(work, ["state", "statistics", "totals"], "total_blocks", [statistics, this.#totals], this.#blocks);
  }

  /** What there is to solve for a budget. The work has to be submitted before the next budget is begun. */
  begin(work: Work, budget: number): void {
    this.#frame.gpu.device.queue.writeBuffer(this.#budget, 0, new Uint32Array([Math.min(budget, CEILING - 1)]));
    this.#run(work, ["state", "begin"], "begin", [this.#totals, this.state, this.#budget], 1);
  }

  /** Finds the price of the budget for the curves. */
  solve(work: Work): void {
    const counts = this.#frame.words("counts", EDGES * this.#blocks);
    const inputs = [this.state, this.#frame.statistics, this.curves, counts];
    const files = ["state", "statistics", "prices", "price_counts"];
    for (let round = 0; round < ROUNDS; ++round) {
      this.#run(work, files, "count_prices", inputs, this.#blocks);
      this.#run(work, ["state", "choose"], "choose", [this.state, counts], 1);
    }
  }

  /** Slots at the price that was found, or n where the budget covers everything; then their prefix sums. */
  place(work: Work): void {
    const { statistics } = this.#frame;
    const found = [this.state, statistics, this.curves, this.#slots, this.#sums];
    this.#run(work, ["state", "statistics", "prices", "slots"], "find_slots", found, this.#blocks);
    this.#run(work, ["state", "scan"], "scan", [this.state, this.#sums], 1);
    const placed = [this.state, this.#slots, this.#sums, this.offsets, this.#budget];
    this.#run(work, ["state", "offsets"], "place_slots", placed, this.#blocks);
  }

  /** The same number of slots for every pixel of the window. */
  placeFixed(work: Work): void {
    this.#frame.forPixels(work, ["fixed"], "place_fixed", [this.offsets, this.#budget], {
      threads: this.#frame.pixels + 1,
    });
  }

  #run(
    work: Work,
    files: readonly string[],
    entryPoint: string,
    buffers: readonly GPUBuffer[],
    groups: number,
  ): void {
    this.#frame.dispatch(work, shader(files), entryPoint, buffers, [groups, 1]);
  }
}
