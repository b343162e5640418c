// Render targets that a pass adds to, and how their textures are blended.

import {
  AddEquation,
  BlendMode,
  CustomBlending,
  HalfFloatType,
  MaxEquation,
  NearestFilter,
  NodeMaterial,
  OneFactor,
  OneMinusSrcAlphaFactor,
  type PixelFormat,
  QuadMesh,
  RenderTarget,
  RGBAFormat,
  type TextureDataType,
  type WebGPURenderer,
} from "three/webgpu";
import { mrt } from "three/tsl";
import type { MRTNode, Node } from "three/webgpu";

export interface Channel {
  readonly name: string;
  readonly format?: PixelFormat;
  readonly type?: TextureDataType;
}

/** Targets of a pass over geometry, half floats of four channels unless told otherwise; nothing is interpolated. */
export function targetOf(channels: readonly Channel[]): RenderTarget {
  const target = new RenderTarget(1, 1, { count: channels.length, depthBuffer: false, samples: 0 });
  channels.forEach(({ name, format = RGBAFormat, type = HalfFloatType }, i) => {
    const texture = target.textures[i]!;
    Object.assign(texture, { name, format, type, minFilter: NearestFilter, magFilter: NearestFilter });
    texture.generateMipmaps = false;
  });
  return target;
}

/** What fragments write, added up from zero; with `isMost` the most of them is kept. */
export function summed(outputs: Readonly<Record<string, Node>>, isMost = false): MRTNode {
  const blending = new BlendMode(CustomBlending);
  blending.blendSrc = blending.blendDst = OneFactor;
  blending.blendEquation = isMost ? MaxEquation : AddEquation;
  const made = mrt(outputs);
  for (const name of Object.keys(outputs)) made.setBlendMode(name, blending).setClearColor(name, 0x000000, 0);
  return made;
}

/** Draws what is transparent into a target. */
export type Draw = (target: RenderTarget, outputs: MRTNode) => void;

/** A pass over the pixels of a target, without depth. */
export class Filter {
  /** Its blending is the caller's; none unless told. */
  readonly material = new NodeMaterial();
  readonly #quad = new QuadMesh(this.material);

  /** @param output Of every pixel. */
  constructor(output: Node) {
    this.material.fragmentNode = output;
    this.material.depthTest = this.material.depthWrite = false;
  }

  /** Leaves the renderer's targets changed, and nothing else. */
  render(renderer: WebGPURenderer, target: RenderTarget): void {
    const { opaque, autoClear } = renderer;
    const chosen = renderer.getRenderObjectFunction();
    Object.assign(renderer, { opaque: true, autoClear: false });
    renderer.setRenderObjectFunction(null);
    renderer.setRenderTarget(target);
    this.#quad.render(renderer);
    renderer.setRenderObjectFunction(chosen);
    Object.assign(renderer, { opaque, autoClear });
  }

  dispose(): void {
    this.material.dispose();
  }
}

/** Puts a picture, colour times coverage and coverage, over what a target has. */
export function over(picture: Node): Filter {
  const made = new Filter(picture);
  Object.assign(made.material, { blending: CustomBlending, blendSrc: OneFactor, blendDst: OneMinusSrcAlphaFactor });
  return made;
}
