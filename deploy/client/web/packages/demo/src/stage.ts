// The canvas: what is shown on it, drawn anew where something has changed, one picture at a time.

import {
  Abandoned,
  type Bundle,
  type Counted,
  framingView,
  Geometry,
  type Gpu,
  meanSquaredError,
  type Mode,
  Renderer,
  type Scene,
  Screen,
  type Technique,
  Trouble,
  type View,
  Work,
} from "@diaphane/core";

/** What one wants to see. */
export interface Wanted {
  left: Technique;
  right: Technique;
  mode: Mode;
  /** Slots a pixel. */
  factor: number;
  /** Share of the width that the left picture has. */
  split: number;
}

/** What a technique has cost, and its error; null as long as it is not measured, NaN where it cannot be. */
export interface Figures {
  readonly technique: Technique;
  readonly milliseconds: number;
  readonly slots: number;
  readonly error: number | null;
}

export interface Report {
  readonly counted: Counted;
  readonly left: Figures;
  readonly right: Figures;
  readonly width: number;
  readonly height: number;
  /** Of the GPU's memory, beside the scene. */
  readonly bytes: number;
}

/** A picture, read back. */
export interface Picture {
  /** sRGB and, in the highest byte, k of every pixel. */
  readonly words: Uint32Array;
  /** Where each pixel's slots begin, and the end of the last one's. */
  readonly offsets: Uint32Array;
  /** N of the view. */
  readonly fragments: number;
}

/** Most pixels of a side. */
const MOST = 1600;
/** After so long without a change errors are measured, ms. */
const REST = 250;

export class Stage {
  readonly wanted: Wanted = { left: "binned", right: "weighted-blended", mode: "picture", factor: 1, split: 0.5 };
  bundle: Bundle | null = null;
  view: View | null = null;
  readonly #screen: Screen;
  #geometry: Geometry | null = null;
  #renderer: Renderer | null = null;
  #busy: Promise<void> | null = null;
  #again = false;
  /** Grows when what is being drawn is no longer wanted. */
  #turn = 0;
  #lost = false;
  #rest: ReturnType<typeof setTimeout> | undefined;
  #shown: Record<"left" | "right" | "exact", GPUBuffer> | null = null;

  /**
   * @param told Gets what was drawn.
   * @param waits Gets whether a picture takes a while.
   * @param failed Gets what went wrong.
   */
  constructor(
    readonly gpu: Gpu,
    readonly canvas: HTMLCanvasElement,
    private readonly told: (report: Report) => void,
    private readonly waits: (is: boolean) => void,
    private readonly failed: (error: unknown) => void,
  ) {
    this.#screen = new Screen(gpu, canvas);
    void gpu.device.lost.then(() => {
      this.#lost = true;
      const remedy = "Load the page again; if it stays so, update the browser and the graphics driver.";
      failed(new Trouble("The graphics device was lost.", remedy));
    });
  }

  /** Shows another scene, all of it. */
  async open(scene: Scene): Promise<void> {
    const geometry = new Geometry(this.gpu, scene); // if it does not fit, what was there stays
    ++this.#turn;
    while (this.#busy) await this.#busy;
    this.#geometry?.destroy();
    this.#geometry = geometry;
    this.#resize(true);
    this.home();
  }

  /** Shows the whole scene. */
  home(): void {
    if (!this.#geometry) return;
    const { bounds, up } = this.#geometry.scene;
    this.view = framingView(bounds, up, this.canvas.width / this.canvas.height);
    this.draw();
  }

  /** Draws soon; errors are measured when nothing changes for a while. */
  draw(): void {
    clearTimeout(this.#rest);
    if (this.#lost) return;
    if (this.#busy) {
      ++this.#turn;
      this.#again = true;
      return;
    }
    this.#while(() => this.#drawAll());
  }

  /** Shows what was drawn once more, with another split or mode; also while something else is being drawn. */
  present(): void {
    if (this.#shown && this.#renderer && !this.#lost) this.#show(this.#renderer);
  }

  /** The picture of a technique at the canvas's size. */
  async picture(view: View, technique: Technique, factor: number): Promise<Picture> {
    while (this.#busy) await this.#busy;
    clearTimeout(this.#rest);
    return new Promise((resolve, reject) => {
      this.#while(async () => {
        try {
          const renderer = this.#resize(false)!;
          const work = new Work(this.gpu);
          const { fragments } = await renderer.look(work, view);
          const words = await this.gpu.read(await renderer.render(work, technique, factor, this.bundle, "picture"));
          resolve({ words, offsets: await this.gpu.read(renderer.offsets), fragments });
        } catch (error) {
          reject(error);
        }
      });
    });
  }

  async #drawAll(): Promise<void> {
    const renderer = this.#resize(false);
    if (!renderer || !this.view) return;
    const work = this.#work();
    const counted = await renderer.look(work, this.view);
    this.waits(renderer.isSlow);
    const left = await this.#side(renderer, work, "left");
    const right = await this.#side(renderer, work, "right");
    const exact = renderer.frame.words("exact", renderer.frame.pixels);
    this.#shown = { left: left.buffer, right: right.buffer, exact };
    if (this.wanted.mode === "error") await renderer.render(work, "sbuffer", 1, null, "exact");
    this.#show(renderer);
    this.#tell(renderer, counted, left.figures, right.figures);
    this.#rest = setTimeout(() => this.#measure(renderer, counted, left.figures, right.figures), REST);
  }

  async #side(
    renderer: Renderer,
    work: Work,
    side: "left" | "right",
  ): Promise<{ buffer: GPUBuffer; figures: Figures }> {
    const technique = this.wanted[side];
    const begun = performance.now();
    const buffer = await renderer.render(work, technique, this.wanted.factor, this.bundle, side);
    await this.gpu.device.queue.onSubmittedWorkDone();
    const milliseconds = performance.now() - begun;
    return { buffer, figures: { technique, milliseconds, slots: renderer.slots, error: null } };
  }

  #measure(renderer: Renderer, counted: Counted, left: Figures, right: Figures): void {
    if (this.#busy || !this.#shown || renderer !== this.#renderer) return;
    const shown = this.#shown;
    this.#while(async () => {
      const errors = await this.#errors(renderer, [shown.left, shown.right]);
      this.#tell(renderer, counted, { ...left, error: errors[0]! }, { ...right, error: errors[1]! });
    });
  }

  /** Errors of pictures; NaN where all fragments are more than the device holds. */
  async #errors(renderer: Renderer, pictures: readonly GPUBuffer[]): Promise<number[]> {
    const errors: number[] = [];
    try {
      const exact = await renderer.render(this.#work(), "sbuffer", 1, null, "exact");
      for (const picture of pictures) errors.push(await meanSquaredError(renderer.frame, picture, exact));
      return errors;
    } catch (error) {
      if (error instanceof Trouble) return pictures.map(() => NaN);
      throw error;
    }
  }

  #tell(renderer: Renderer, counted: Counted, left: Figures, right: Figures): void {
    const { width, height, bytes } = renderer.frame;
    this.told({ counted, left, right, width, height, bytes });
  }

  /** For a picture that is given up as soon as another is wanted. */
  #work(): Work {
    const turn = this.#turn;
    return new Work(this.gpu, () => turn === this.#turn);
  }

  /** Nothing else is drawn while this is. */
  #while(work: () => Promise<void>): void {
    this.#busy = work()
      .catch((error: unknown) => {
        // No buffer can be mapped any more: the device is about to be lost, which is said then.
        const isLost = this.#lost || (error instanceof DOMException && error.name === "AbortError");
        if (isLost || error instanceof Abandoned) return;
        this.#shown = null;
        this.#screen.clear();
        this.failed(error);
      })
      .finally(() => {
        this.#busy = null;
        this.waits(false);
        if (!this.#again) return;
        this.#again = false;
        this.draw();
      });
  }

  #show(renderer: Renderer): void {
    const { left, right, exact } = this.#shown!;
    const { mode, split } = this.wanted;
    this.#screen.show(renderer.frame, mode, split * renderer.frame.width, left, right, exact);
  }

  /** The renderer of the canvas's size; a new one where it, or the scene, is another. */
  #resize(anew: boolean): Renderer | null {
    if (!this.#geometry) return null;
    const box = this.canvas.getBoundingClientRect();
    const width = Math.min(Math.max(Math.round(box.width), 1), MOST);
    const height = Math.min(Math.max(Math.round(box.height), 1), MOST);
    const before = this.#renderer;
    if (!anew && before && before.frame.width === width && before.frame.height === height) return before;
    before?.destroy();
    [this.#renderer, this.#shown] = [null, null];
    [this.canvas.width, this.canvas.height] = [width, height];
    this.#renderer = new Renderer(this.gpu, this.#geometry, width, height);
    return this.#renderer;
  }
}
