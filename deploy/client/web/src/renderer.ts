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
import { CEILING, TURNS } from "./shaders";
import { DEFAULT_TAIL, type Tail } from "./tail";
import { Trouble } from "./trouble";
import { Work } from "./work";

export const TECHNIQUES = ["kbuffer-deep", "kbuffer", "weighted-blended", "sbuffer"] as const;
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
   * Begins a view: the opaque surfaces, and how many transparent fragments there are.
   *
   * @param work Nothing is pending in it.
   * @throws Trouble There is too much to draw.
   */
  async look(work: Work, view: View): Promise<Counted> {
    this.#sums = null;
    await this.frame.draw(work, view, this.#geometry.scene.bounds, CLEAR);
    this.#allocation.count(work);
    this.#allocation.begin(work, CEILING);
    work.submit();
    const [fragments, occupied, deepest] = await this.#allocation.totals();
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
      "kbuffer-deep": Math.min(budget, fragments),
      kbuffer: budget,
      "weighted-blended": 0,
      sbuffer: fragments,
    }[technique];
    if (technique === "sbuffer") await this.#renderExact(work, into);
    else if (technique === "weighted-blended") await renderBlended(frame, work, into);
    else await this.#renderChain(work, technique, this.#slots, bundle, into);
    work.submit();
    return into;
  }

  async #renderExact(work: Work, into: GPUBuffer): Promise<void> {
    this.#allocation.begin(work, CEILING);
    this.#allocation.place(work);
    await renderExact(this.frame, work, this.#allocation.offsets, this.#counted.fragments, into);
  }

  async #renderChain(
    work: Work,
    technique: "kbuffer" | "kbuffer-deep",
    budget: number,
    bundle: Bundle | null,
    into: GPUBuffer,
  ): Promise<void> {
    const [frame, allocation] = [this.frame, this.#allocation];
    allocation.begin(work, budget);
    if (technique === "kbuffer") {
      const sums = await this.#gathered(work, DEFAULT_TAIL, false);
      allocation.placeFixed(work);
      await renderChain(frame, work, allocation.offsets, budget, sums, into);
      return;
    }
    if (!bundle) throw new Trouble("There is no bundle for kbuffer-deep.", "Choose a model.");
    const sums = await this.#gathered(work, bundle.tail, true);
    predict(frame, work, bundle, sums, allocation);
    allocation.solve(work);
    allocation.place(work);
    await renderChain(frame, work, allocation.offsets, budget, sums, into);
  }

  /** What was gathered for a tail of as many bins serves this one. */
  async #gathered(work: Work, tail: Tail, all: boolean): Promise<Sums> {
    const before = this.#sums;
    if (before && before.tail.bins === tail.bins && (!all || before.targets.length > 0)) return { ...before, tail };
    this.#sums = null; // what there was is overwritten
    this.#sums = await gather(this.frame, work, tail, all);
    return this.#sums;
  }
}
