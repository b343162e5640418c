// What the pass does after the opaque objects: the passes of a technique over transparent ones, and the composite.

import { type Bundle, Gpu } from "@diaphane/core";
import type { MRTNode, Object3D, OrthographicCamera, PerspectiveCamera, RenderTarget, WebGPURenderer } from "three/webgpu";
import { Bins } from "./bins";
import { Core, MOST } from "./core";
import { Deep } from "./deep";
import { Range } from "./range";
import { Depth } from "./surface";
import { Tail } from "./tail";
import { type Draw, type Filter, over, summed } from "./targets";
import { forget } from "./upkeep";
import { Visible } from "./visible";

/** Depth bins alone; the same number of slots for every pixel; those that a bundle's network gives it. */
export type Technique = "binned" | "kbuffer" | "kbuffer-deep";

/** What a frame is to be rendered with. */
export interface Wanted {
  readonly technique: Technique;
  /** Slots of a pixel: of every one, or for `kbuffer-deep` on average. */
  readonly budget: number;
  readonly bundle: Bundle | null;
}

/** What is drawn into the bins, into the tail's sums, and over the picture. */
interface Passes {
  readonly bins: MRTNode;
  readonly tail: MRTNode;
  readonly over: Filter;
}

export class Techniques {
  readonly #depth = new Depth();
  readonly #range: Range;
  readonly #bins: Bins;
  readonly #tail = new Tail();
  readonly #binned: Passes;
  readonly #visible: Visible;
  #core: { readonly slots: Core; readonly passes: Passes } | null = null;
  #deep: Deep | null = null;
  #gpu: Gpu | null = null;
  #width = 1;
  #height = 1;
  #said = "";

  /** @param picture Has the opaque objects, and their depth. */
  constructor(
    readonly renderer: WebGPURenderer,
    private readonly picture: RenderTarget,
  ) {
    this.#range = new Range(this.#depth, canBlendFloats(renderer));
    this.#visible = new Visible(picture);
    this.#bins = new Bins(this.#depth.here, this.#range.here);
    this.#binned = {
      bins: summed(this.#bins.outputs(this.#visible.share)),
      tail: this.#tail.mrt(this.#bins.weight, this.#visible.share),
      over: over(this.#tail.picture),
    };
    this.setSize(picture.width, picture.height);
  }

  setSize(width: number, height: number): void {
    this.#range.setSize(width, height);
    this.#bins.target.setSize(width, height);
    this.#tail.target.setSize(width, height);
    [this.#width, this.#height] = [width, height];
  }

  /** Begins a frame. */
  begin(camera: PerspectiveCamera | OrthographicCamera): void {
    this.#depth.update(camera);
    this.#range.begin();
  }

  /** An object will be drawn. */
  cover(object: Object3D, camera: PerspectiveCamera | OrthographicCamera): void {
    this.#range.cover(object, camera);
  }

  /** What a bundle's network gave to the pixels of the last picture; null: it had no part in it. */
  get deep(): Deep | null {
    return this.#deep;
  }

  /**
   * @param wanted Where the device has no room for it, depth bins are used.
   * @param draw Draws what is transparent.
   */
  render(wanted: Wanted, draw: Draw): void {
    const { technique, budget, bundle } = this.#possible(wanted);
    if (technique !== "kbuffer") this.#core?.slots.release();
    if (technique !== "kbuffer-deep") this.#deep?.release();
    draw(this.#range.target, this.#range.mrt);
    this.#range.fill(this.renderer);
    if (technique === "kbuffer-deep") return this.#deepFor(bundle!).render(bundle!, budget, draw);
    const { bins, tail, over } = technique === "kbuffer" ? this.#kept(budget) : this.#binned;
    draw(this.#bins.target, bins);
    draw(this.#tail.target, tail);
    over.render(this.renderer, this.picture);
  }

  #kept(k: number): Passes {
    this.#core ??= this.#madeCore();
    this.#core.slots.resize(this.#width, this.#height, k);
    return this.#core.passes;
  }

  #madeCore(): { readonly slots: Core; readonly passes: Passes } {
    const slots = new Core(this.#depth.here, this.#visible);
    const outputs = this.#bins.outputs(this.#visible.share);
    const [first] = Object.keys(outputs);
    const bins = summed({ ...outputs, [first!]: slots.inserting(outputs[first!]!) });
    const tail = this.#tail.mrt(this.#bins.weight, slots.remaining);
    return { slots, passes: { bins, tail, over: over(slots.over(this.#tail.picture)) } };
  }

  /** Bundles of one tail share what is compiled. */
  #deepFor({ tail }: Bundle): Deep {
    if (this.#deep && this.#deep.bins.name !== tail.name) {
      this.#deep.dispose();
      this.#deep = null;
    }
    this.#gpu ??= Gpu.of(deviceOf(this.renderer)!);
    const [gpu, depth] = [this.#gpu, this.#depth.here];
    return (this.#deep ??= new Deep(this.renderer, gpu, tail, depth, this.#range, this.#tail, this.#visible, this.picture));
  }

  /** What the device can do of what is wanted; says once why not. */
  #possible({ technique, budget, bundle }: Wanted): Wanted {
    const binned: Wanted = { technique: "binned", budget: 0, bundle };
    const isDeep = technique === "kbuffer-deep";
    const k = isDeep ? Math.max(budget, 0) : Math.min(Math.max(Math.floor(budget), 0), MOST);
    if (technique === "binned" || !(k > 0)) return binned;
    const pixels = this.#width * this.#height;
    const why =
      isDeep && !bundle
        ? "There is no bundle for kbuffer-deep."
        : refusal(this.renderer, isDeep ? Deep.bytes(pixels, k, bundle!.tail) : Core.bytes(this.#width, this.#height, k));
    if (why && why !== this.#said) console.warn(`${why} Depth bins alone are used.`);
    this.#said = why;
    return why ? binned : { technique, budget: k, bundle };
  }

  dispose(): void {
    const passes = [this.#binned, ...(this.#core ? [this.#core.passes] : [])];
    forget(this.renderer, new Set([this.#range.mrt, ...passes.flatMap(({ bins, tail }) => [bins, tail])]));
    this.#range.dispose();
    this.#bins.target.dispose();
    this.#tail.target.dispose();
    this.#binned.over.dispose();
    this.#core?.slots.dispose();
    this.#core?.passes.over.dispose();
    this.#deep?.dispose();
  }
}

function canBlendFloats(renderer: WebGPURenderer): boolean {
  return renderer.hasFeature("float32-blendable");
}

/** Of WebGPU; null: the renderer has WebGL 2. */
function deviceOf(renderer: WebGPURenderer): GPUDevice | null {
  return (renderer.backend as unknown as { device?: GPUDevice | null }).device ?? null;
}

/** Why a device has no slots of so many bytes in one buffer; empty: it has. */
function refusal(renderer: WebGPURenderer, bytes: number): string {
  const limits = deviceOf(renderer)?.limits;
  if (!limits) return "A budget needs WebGPU, and this is WebGL 2.";
  const most = Math.min(limits.maxStorageBufferBindingSize, limits.maxBufferSize);
  if (bytes > most) return `A budget of ${bytes} bytes in one buffer is above the ${most} of this device.`;
  return "";
}
