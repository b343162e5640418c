// What the pass does after the opaque objects: the passes of a technique over transparent ones, and the composite.

import {
  CustomBlending,
  type MRTNode,
  type Node,
  type Object3D,
  OneFactor,
  OneMinusSrcAlphaFactor,
  type OrthographicCamera,
  type PerspectiveCamera,
  type RenderTarget,
  type WebGPURenderer,
} from "three/webgpu";
import { float } from "three/tsl";
import { Bins } from "./bins";
import { Core, MOST } from "./core";
import { Range } from "./range";
import { Depth } from "./surface";
import { Tail } from "./tail";
import { Filter, summed } from "./targets";

/** What is drawn into the bins, into the tail's sums, and over the picture. */
interface Passes {
  readonly bins: MRTNode;
  readonly tail: MRTNode;
  readonly over: Filter;
}

type Draw = (target: RenderTarget, outputs: MRTNode) => void;

export class Techniques {
  readonly #depth = new Depth();
  readonly #range: Range;
  readonly #bins: Bins;
  readonly #tail = new Tail();
  readonly #binned: Passes;
  #core: { readonly slots: Core; readonly passes: Passes } | null = null;
  #width = 1;
  #height = 1;
  #said = "";

  /** @param picture Has the opaque objects, and their depth. */
  constructor(
    private readonly renderer: WebGPURenderer,
    private readonly picture: RenderTarget,
  ) {
    this.#range = new Range(this.#depth, canBlendFloats(renderer));
    this.#bins = new Bins(this.#depth.here, this.#range.here);
    this.#bins.target.depthTexture = this.#tail.target.depthTexture = picture.depthTexture;
    this.#binned = {
      bins: summed(this.#bins.outputs()),
      tail: this.#tail.mrt(this.#bins.weight, float(1)),
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

  /**
   * @param budget Slots of every pixel.
   * @param draw Draws what is transparent.
   */
  render(budget: number, draw: Draw): void {
    const { bins, tail, over } = this.#passes(budget);
    draw(this.#range.target, this.#range.mrt);
    this.#range.fill(this.renderer);
    draw(this.#bins.target, bins);
    draw(this.#tail.target, tail);
    over.render(this.renderer, this.picture);
  }

  #passes(budget: number): Passes {
    const k = Math.min(Math.max(Math.floor(budget), 0), MOST);
    if (k === 0 || !this.#fits(k)) {
      this.#dropCore();
      return this.#binned;
    }
    this.#core ??= this.#madeCore();
    this.#core.slots.resize(this.#width, this.#height, k);
    return this.#core.passes;
  }

  #madeCore(): { readonly slots: Core; readonly passes: Passes } {
    const slots = new Core(this.#depth.here, this.picture);
    const outputs = this.#bins.outputs(slots.shown);
    const [first] = Object.keys(outputs);
    const bins = summed({ ...outputs, [first!]: slots.inserting(outputs[first!]!) });
    const tail = this.#tail.mrt(this.#bins.weight, slots.remaining);
    return { slots, passes: { bins, tail, over: over(slots.over(this.#tail.picture)) } };
  }

  #dropCore(): void {
    this.#core?.slots.dispose();
    this.#core?.passes.over.dispose();
    this.#core = null;
  }

  /** Whether there can be slots; says once why not. */
  #fits(k: number): boolean {
    const why = refusal(this.renderer, Core.bytes(this.#width, this.#height, k));
    if (why && why !== this.#said) console.warn(`${why} Depth bins alone are used.`);
    this.#said = why;
    return !why;
  }

  dispose(): void {
    this.#range.dispose();
    this.#bins.target.dispose();
    this.#tail.target.dispose();
    this.#binned.over.dispose();
    this.#dropCore();
  }
}

/** Puts a picture, colour times coverage and coverage, over what a target has. */
function over(picture: Node<"vec4">): Filter {
  const made = new Filter(picture);
  Object.assign(made.material, { blending: CustomBlending, blendSrc: OneFactor, blendDst: OneMinusSrcAlphaFactor });
  return made;
}

function canBlendFloats(renderer: WebGPURenderer): boolean {
  return renderer.hasFeature("float32-blendable");
}

/** Why a device has no slots of so many bytes in one buffer; empty: it has. */
function refusal(renderer: WebGPURenderer, bytes: number): string {
  const { backend } = renderer as unknown as { backend: { isWebGPUBackend?: boolean; device?: GPUDevice } };
  const { limits } = backend.device ?? {};
  if (backend.isWebGPUBackend !== true || !limits) return "A budget needs WebGPU, and this is WebGL 2.";
  if (renderer.reversedDepthBuffer || renderer.logarithmicDepthBuffer)
    return "A budget needs the depth buffer as three.js has it unless told otherwise, not reversed or logarithmic.";
  const most = Math.min(limits.maxStorageBufferBindingSize, limits.maxBufferSize);
  if (bytes > most) return `A budget of ${bytes} bytes in one buffer is above the ${most} of this device.`;
  return "";
}
