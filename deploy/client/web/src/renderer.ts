// Techniques on one scene: what they share of a view is made once.

import type { Bundle } from "./bundle";
import type { View } from "./camera";
import type { Gpu } from "./gpu";
import { Allocation, budgetOf } from "./passes/allocation";
import { renderBlended } from "./passes/blended";
import { renderChain } from "./passes/chain";
import { renderExact } from "./passes/exact";
import { Frame } from "./passes/frame";
import { Geometry } from "./passes/geometry";
import { predict } from "./passes/network";
import { type Sums, gather } from "./passes/sums";
import { CEILING } from "./shaders";
import { Trouble } from "./trouble";

export const TECHNIQUES = ["kbuffer-deep", "kbuffer", "weighted-blended", "sbuffer"] as const;
export type Technique = (typeof TECHNIQUES)[number];

/** Linear grey behind everything. */
const CLEAR = 1.0;
const DEFAULT_BINS = 16;

/** What a view has. */
export interface Counted {
  readonly fragments: number;
  readonly occupied: number;
}

export class Renderer {
  readonly frame: Frame;
  readonly #allocation: Allocation;
  readonly #geometry: Geometry;
  #counted: Counted = { fragments: 0, occupied: 0 };
  #sums: Sums | null = null;
  #slots = 0;

  constructor(
    readonly gpu: Gpu,
    geometry: Geometry,
    width: number,
    height: number,
  ) {
    this.#geometry = geometry;
    this.frame = new Frame(gpu, geometry, width, height);
    this.#allocation = new Allocation(this.frame);
  }

  destroy(): void {
    this.frame.destroy();
  }

  /** Where each pixel's run of slots began in the last picture with slots. */
  get offsets(): GPUBuffer {
    return this.#allocation.offsets;
  }

  /** Slots of the last picture; 0 where all fragments are blended. */
  get slots(): number {
    return this.#slots;
  }

  /** Begins a view: the opaque surfaces, and how many transparent fragments there are. */
  async look(view: View): Promise<Counted> {
    const { frame, gpu } = this;
    const encoder = gpu.device.createCommandEncoder();
    frame.draw(encoder, view, this.#geometry.scene.bounds, CLEAR);
    this.#allocation.count(encoder);
    this.#allocation.begin(encoder, CEILING);
    gpu.device.queue.submit([encoder.finish()]);
    this.#sums = null;
    const state = await gpu.read(this.#allocation.state);
    this.#counted = { fragments: state[0]!, occupied: state[1]! };
    return this.#counted;
  }

  /**
   * Renders the view that was begun.
   *
   * @param factor Slots a pixel of the window on average: F / (W H).
   * @param bundle For `kbuffer-deep`.
   * @param shown Name of the buffer that gets the picture.
   * @returns The picture: sRGB and k, a byte each, of every pixel.
   */
  render(technique: Technique, factor: number, bundle: Bundle | null, shown: string): GPUBuffer {
    const { frame, gpu } = this;
    const into = frame.words(shown, frame.pixels);
    const encoder = gpu.device.createCommandEncoder();
    const { fragments } = this.#counted;
    const budget = budgetOf(factor, frame.pixels);
    // What a fixed k leaves empty is allocted, too; to kbuffer-deep more slots than fragments would be of no use.
    this.#slots = {
      "kbuffer-deep": Math.min(budget, fragments),
      kbuffer: budget,
      "weighted-blended": 0,
      sbuffer: fragments,
    }[technique];
    if (technique === "sbuffer") this.#renderExact(encoder, into);
    else if (technique === "weighted-blended") renderBlended(frame, encoder, into);
    else this.#renderChain(encoder, technique, this.#slots, bundle, into);
    gpu.device.queue.submit([encoder.finish()]);
    return into;
  }

  #renderExact(encoder: GPUCommandEncoder, into: GPUBuffer): void {
    this.#allocation.begin(encoder, CEILING);
    this.#allocation.place(encoder);
    renderExact(this.frame, encoder, this.#allocation.offsets, this.#counted.fragments, into);
  }

  #renderChain(
    encoder: GPUCommandEncoder,
    technique: "kbuffer" | "kbuffer-deep",
    budget: number,
    bundle: Bundle | null,
    into: GPUBuffer,
  ): void {
    const [frame, allocation] = [this.frame, this.#allocation];
    allocation.begin(encoder, budget);
    if (technique === "kbuffer") {
      const sums = this.#gathered(encoder, DEFAULT_BINS, false);
      allocation.placeFixed(encoder);
      renderChain(frame, encoder, allocation.offsets, budget, sums, into);
      return;
    }
    if (!bundle) throw new Trouble("There is no bundle for kbuffer-deep.", "Choose a model.");
    const sums = this.#gathered(encoder, bundle.bins, true);
    predict(frame, encoder, bundle, sums, allocation);
    allocation.solve(encoder);
    allocation.place(encoder);
    renderChain(frame, encoder, allocation.offsets, budget, sums, into);
  }

  #gathered(encoder: GPUCommandEncoder, bins: number, all: boolean): Sums {
    const before = this.#sums;
    if (before && before.bins === bins && (!all || before.targets.length > 0)) return before;
    this.#sums = gather(this.frame, encoder, bins, all);
    return this.#sums;
  }
}
