// Cores of a picture that somebody else draws: between its passes over the geometry, what of the fragments is kept, what
// the network says of them, and which of them the budget holds.

import type { Bundle } from "../bundle";
import { CONSTANTS } from "../generated";
import type { Gpu } from "../gpu";
import type { Tail } from "../tail";
import { Work } from "../work";
import { Allocation, budgetOf } from "./allocation";
import { packBins } from "./bins";
import { predict } from "./network";
import { Store } from "./store";

const TILE = Number(CONSTANTS["RANGE_TILE"]);
/** Words of a slot: half_slot.wgsl. */
export const SLOT_WORDS = 3;

export class Cores {
  readonly #store: Store;
  readonly #allocation: Allocation;
  readonly #tiles: number;

  constructor(
    private readonly gpu: Gpu,
    width: number,
    height: number,
    private readonly tail: Tail,
  ) {
    this.#store = new Store(gpu, width, height);
    this.#allocation = new Allocation(this.#store);
    this.#tiles = Math.ceil(width / TILE) * Math.ceil(height / TILE);
  }

  get width(): number {
    return this.#store.width;
  }

  get height(): number {
    return this.#store.height;
  }

  /** [P][BINS], what fragments are added to (add_to_bins.wgsl); after `select`, what is kept (bin_words.wgsl). */
  get words(): GPUBuffer {
    return this.#store.words("bins", this.tail.bins * this.#store.pixels);
  }

  /** [P], sums of luma and of its square. */
  get luma(): GPUBuffer {
    return this.#store.words("luma", this.#store.pixels);
  }

  /** [P + 1], where each pixel's run of slots begins. */
  get offsets(): GPUBuffer {
    return this.#allocation.offsets;
  }

  /** [P], bins of the core. */
  get cuts(): GPUBuffer {
    return this.#allocation.cuts;
  }

  /** [P], fragments captured. */
  get cursors(): GPUBuffer {
    return this.#store.words("cursors", this.#store.pixels);
  }

  /** F, at a number of slots a pixel. */
  slots(factor: number): number {
    return budgetOf(factor, this.#store.pixels);
  }

  /** [F] slots at least, half_slot.wgsl. */
  pool(slots: number): GPUBuffer {
    return this.#store.room("pool", SLOT_WORDS * Math.max(slots, 1)); // a binding holds one at least
  }

  /** Before fragments are gathered: nothing is there. */
  begin(): void {
    const work = new Work(this.gpu);
    for (const each of [this.words, this.luma, this.cursors]) work.encoder.clearBuffer(each);
    work.submit();
  }

  /**
   * After fragments were gathered, and before they are captured: which of them are.
   *
   * @param bundle Its network; of the same tail.
   * @param slots F.
   * @param tiles Inverse of the nearest depth, and farthest depth, of every tile; in any unit.
   * @param background Of every pixel, gamma-2 encoded.
   */
  select(bundle: Bundle, slots: number, tiles: GPUTexture, background: GPUTexture): void {
    const { tail, words, luma } = this;
    const work = new Work(this.gpu);
    const ranges = this.#store.words("ranges", 2 * this.#tiles);
    const threads = this.#tiles;
    this.#store.forPixels(work, ["take_ranges"], "take_ranges", [tiles.createView(), ranges], { threads });
    packBins(this.#store, work, tail, words);
    const binned = { tail, words, luma };
    this.#allocation.begin(work, binned, slots);
    predict(this.#store, work, bundle, binned, this.#allocation, ranges, background);
    this.#allocation.place(work, binned);
    work.submit();
  }

  /** After fragments were captured: each run front to back. */
  sort(slots: number): void {
    const work = new Work(this.gpu);
    this.#store.forPixels(work, ["half_slot", "sort"], "sort_runs", [this.offsets, this.cursors, this.pool(slots)]);
    work.submit();
  }

  /** Bytes of its buffers. */
  get bytes(): number {
    return this.#store.bytes;
  }

  destroy(): void {
    this.#store.destroy();
    this.#allocation.destroy();
  }
}
