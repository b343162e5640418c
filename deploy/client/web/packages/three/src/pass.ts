// The pass: opaque objects as three.js draws them, then transparent ones in any order, over them.

import type { Bundle } from "@diaphane/core";
import {
  type Material,
  type NodeFrame,
  type Object3D,
  type OrthographicCamera,
  PassNode,
  type PerspectiveCamera,
  type RenderTarget,
  RendererUtils,
  type Scene,
  type WebGPURenderer,
} from "three/webgpu";
import type { MRTNode } from "three/webgpu";
import { isOurs, transmits } from "./surface";
import { renewing } from "./upkeep";
import { type Technique, Techniques } from "./techniques";

export interface DiaphaneOptions {
  /** Slots of a pixel, for fragments that are composited exactly; 0, unless told, is depth bins alone. */
  readonly budget?: number;
  /** Of `@diaphane/core`; its network shares the budget out between the pixels. */
  readonly bundle?: Bundle | null;
  /** `kbuffer-deep` where there is a bundle, else `kbuffer`, unless told. */
  readonly technique?: Technique;
}

type View = PerspectiveCamera | OrthographicCamera;
type Seen = (object: Object3D, material: Material) => boolean;

/**
 * A pass in the place of three.js's own: opaque objects, and over them transparent ones, composited per pixel and not by
 * object.
 */
export class DiaphanePassNode extends PassNode {
  /**
   * Slots of a pixel, for fragments that are composited exactly: of every pixel, whole numbers up to 8; of
   * `kbuffer-deep` on average, any number. This, the technique and the bundle can be changed at any time.
   */
  budget: number;
  technique: Technique;
  bundle: Bundle | null;
  readonly #scene: Scene;
  readonly #view: View;
  #techniques: Techniques | null = null;
  #hasWarned = false;

  /** @param options As `diaphanePass` takes them. */
  constructor(scene: Scene, camera: View, { budget = 0, bundle = null, technique }: DiaphaneOptions = {}) {
    super(PassNode.COLOR, scene, camera, { samples: 0 });
    this.budget = budget;
    this.bundle = bundle;
    this.technique = technique ?? (bundle ? "kbuffer-deep" : "kbuffer");
    this.#scene = scene;
    this.#view = camera;
  }

  static get type(): string {
    return "DiaphanePassNode";
  }

  override setMRT(): this {
    throw new Error("This pass has one output, its picture. Add a pass of three.js for what else is wanted of the scene.");
  }

  override setSize(width: number, height: number): void {
    super.setSize(width, height);
    this.#techniques?.setSize(this.renderTarget.width, this.renderTarget.height);
  }

  override updateBefore(frame: NodeFrame): undefined {
    const renderer = frame.renderer as WebGPURenderer;
    if (this.#techniques?.renderer !== renderer) this.#begun(renderer);
    const techniques = this.#techniques!;
    techniques.begin(this.#view);
    let isEmpty = true;
    const before = renderer.getRenderObjectFunction();
    this.#only(renderer, (object, material) => {
      if (!isOurs(material)) return this.#warned(material);
      techniques.cover(object, this.#view);
      isEmpty = false;
      return false;
    });
    super.updateBefore(frame);
    if (!isEmpty) this.#composite(renderer, techniques);
    renderer.setRenderObjectFunction(before);
    return undefined;
  }

  /** What `kbuffer-deep` gave the pixels of the last picture, rows from the top; null: it had no part in it. */
  async slots(): Promise<{ readonly budget: number; readonly k: Uint32Array } | null> {
    const deep = this.#techniques?.deep;
    if (!deep?.slots) return null;
    const offsets = await deep.offsets();
    return { budget: deep.slots, k: offsets.subarray(1).map((end, p) => end - offsets[p]!) };
  }

  /** Another renderer follows one whose device was lost: nothing of that can be used. */
  #begun(renderer: WebGPURenderer): void {
    this.#techniques?.dispose();
    this.#techniques = new Techniques(renderer, this.renderTarget);
  }

  #composite(renderer: WebGPURenderer, techniques: Techniques): void {
    const state = RendererUtils.saveRendererState(renderer);
    // What is behind must not be added to the sums.
    const scene = RendererUtils.resetSceneState(this.#scene, {} as RendererUtils.SceneState);
    const { mask } = this.#view.layers;
    const layers = this.getLayers();
    if (layers) this.#view.layers.mask = layers.mask;
    this.#only(renderer, (_, material) => isOurs(material));
    Object.assign(renderer, { opaque: false, transparent: true, autoClear: true, autoClearColor: true });
    renderer.autoClearDepth = renderer.autoClearStencil = false;
    const { contextNode } = renderer;
    renderer.contextNode = renewing(renderer);
    techniques.render(this, (target: RenderTarget, outputs: MRTNode) => {
      renderer.setRenderTarget(target);
      renderer.setMRT(outputs);
      renderer.render(this.#scene, this.#view);
      renderer.setMRT(null);
    });
    renderer.contextNode = contextNode;
    this.#view.layers.mask = mask;
    RendererUtils.restoreSceneState(this.#scene, scene);
    RendererUtils.restoreRendererState(renderer, state);
  }

  /** Draws what is chosen of a scene; of that which is ours, no depth is written. */
  #only(renderer: WebGPURenderer, isChosen: Seen): void {
    renderer.setRenderObjectFunction((object, scene, camera, geometry, material, ...rest) => {
      if (!isChosen(object, material)) return;
      const { depthWrite } = material;
      if (isOurs(material)) material.depthWrite = false;
      renderer.renderObject(object, scene, camera, geometry, material, ...rest);
      material.depthWrite = depthWrite;
    });
  }

  #warned(material: Material): true {
    if (transmits(material) && !this.#hasWarned) {
      this.#hasWarned = true;
      console.warn(
        `The material "${material.name}" transmits light. three.js draws it beneath what is transparent, since it reads ` +
          "what is behind it. Use opacity in the place of transmission to have it composited.",
      );
    }
    return true;
  }

  override dispose(): void {
    this.#techniques?.dispose();
    this.#techniques = null;
    super.dispose();
  }
}

/**
 * Renders a scene with order-independent transparency.
 *
 * @param scene Opaque objects are drawn as three.js does; transparent ones of `NormalBlending` without transmission are
 *   composited per pixel, whatever their order and however they meet.
 * @param camera Of the view.
 * @param options The budget.
 * @returns A node for the output of a `RenderPipeline`, linear and premultiplied as every pass of three.js is.
 */
export function diaphanePass(scene: Scene, camera: View, options?: DiaphaneOptions): DiaphanePassNode {
  return new DiaphanePassNode(scene, camera, options);
}
