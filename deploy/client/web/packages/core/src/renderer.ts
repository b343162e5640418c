// Techniques on one scene: what they share of a view is made once.

import type { Bundle } from "./bundle";
import type { View } from "./camera";
import type { Gpu } from "./gpu";
import { Allocation, budgetOf } from "./passes/allocation";
import { renderBinned } from "./passes/binned";
import { type Binned, gatherBins } from "./passes/bins";
import { renderBlended } from "./passes/blended";
import { renderChain } from "./passes/chain";
import { renderCore } from "./passes/core";
import { renderExact } from "./passes/exact";
import { Frame } from "./passes/frame";
import { Geometry } from "./passes/geometry";
import { predict } from "./passes/network";
import { TURNS } from "./shaders";
import { DEFAULT_TAIL, FINEST_TAIL, type Tail } from "./tail";
import { Trouble } from "./trouble";
import { Work } from "./work";

export const TECHNIQUES = ["binned", "kbuffer-deep", "kbuffer", "weighted-blended", "sbuffer"] as const;
export type Technique = (typeof TECHNIQUES)[number];

/** Linear grey behind everything. */
const CLEAR = 1.0;

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
  #binned: Binned | null = null;
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

  /** Whether drawing the view that was begun takes so long that there are pauses. */
  get isSlow(): boolean {
    return this.#geometry.isSlow;
  }

  /** Where each pixel's run of slots began in the last picture with slots. */
  get offsets(): GPUBuffer {
    return this.#allocation.offsets;
  }

  /** Slots of the last picture; 0 where all fragments are blended. */
  get slots(): number {
    return this.#slots;
  }

  /**
   * Begins a view: the opaque surfaces, how many transparent fragments there are, and where depth bins lie.
   *
   * @param work Nothing is pending in it.
   * @throws Trouble There is too much to draw.
   */
  async look(work: Work, view: View): Promise<Counted> {
    this.#binned = null;
    await this.frame.draw(work, view, this.#geometry.scene.bounds, CLEAR);
    const [fragments, occupied, deepest] = await this.#allocation.totals(work, this.frame.counts);
    if (deepest > TURNS) {
      const [found, most] = [deepest, TURNS].map((each) => each.toLocaleString("en"));
      throw new Trouble(
        `A pixel has ${found} transparent fragments; up to ${most} can be drawn here.`,
        "Look from elsewhere, or open a simpler scene.",
      );
    }
    this.#counted = { fragments, occupied };
    return this.#counted;
  }

  /**
   * Renders the view that was begun.
   *
   * @param work Nothing is pending in it.
   * @param factor Slots a pixel of the window on average: F / (W H).
   * @param bundle For `kbuffer-deep`.
   * @param shown Name of the buffer that gets the picture.
   * @returns The picture: sRGB and k, a byte each, of every pixel.
   */
  async render(
    work: Work,
    technique: Technique,
    factor: number,
    bundle: Bundle | null,
    shown: string,
  ): Promise<GPUBuffer> {
    const { frame } = this;
    const into = frame.words(shown, frame.pixels);
    const { fragments } = this.#counted;
    const budget = budgetOf(factor, frame.pixels);
    // What a fixed k leaves empty is allocted, too; to kbuffer-deep more slots than fragments would be of no use.
    this.#slots = {
      binned: 0,
      "kbuffer-deep": Math.min(budget, fragments),
      kbuffer: budget,
      "weighted-blended": 0,
      sbuffer: fragments,
    }[technique];
    if (technique === "sbuffer") await this.#renderExact(work, into);
    else if (technique === "weighted-blended") await renderBlended(frame, work, into);
    else if (technique === "binned") await renderBinned(frame, work, await this.#gathered(work, FINEST_TAIL, false), into);
    else if (technique === "kbuffer") await this.#renderFixed(work, this.#slots, into);
    else await this.#renderDeep(work, this.#slots, bundle, into);
    work.submit();
    return into;
  }

  async #renderExact(work: Work, into: GPUBuffer): Promise<void> {
    this.#allocation.placeAll(work, this.frame.counts);
    await renderExact(this.frame, work, this.#allocation.offsets, this.#counted.fragments, into);
  }

  async #renderFixed(work: Work, slots: number, into: GPUBuffer): Promise<void> {
    const binned = await this.#gathered(work, DEFAULT_TAIL, false);
    this.#allocation.placeFixed(work, slots);
    await renderChain(this.frame, work, this.#allocation.offsets, slots, binned, into);
  }

  async #renderDeep(work: Work, budget: number, bundle: Bundle | null, into: GPUBuffer): Promise<void> {
    if (!bundle) throw new Trouble("There is no bundle for kbuffer-deep.", "Choose a model.");
    const [frame, allocation] = [this.frame, this.#allocation];
    const binned = await this.#gathered(work, bundle.tail, true);
    allocation.begin(work, binned, budget);
    predict(frame, work, bundle, binned, allocation, frame.ranges, frame.background);
    allocation.place(work, binned);
    await renderCore(frame, work, binned, allocation, budget, into);
  }

  /** What was gathered for the same tail serves again. */
  async #gathered(work: Work, tail: Tail, all: boolean): Promise<Binned> {
    const before = this.#binned;
    if (before && before.tail.name === tail.name && (!all || before.luma)) return before;
    this.#binned = null; // what there was is overwritten
    this.#binned = await gatherBins(this.frame, work, tail, all);
    return this.#binned;
  }
}
