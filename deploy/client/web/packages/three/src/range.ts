// Range of depths of every tile of pixels (METHOD.md section 2): transparent geometry at a quarter of the resolution,
// then, where none of it was met, what is around, else what the objects' bounds say.

import { CONSTANTS } from "@diaphane/core";
import {
  type Camera,
  FloatType,
  HalfFloatType,
  type MRTNode,
  type Node,
  type Object3D,
  RGFormat,
  type RenderTarget,
  Sphere,
  type TextureDataType,
  Vector2,
  Vector3,
  type WebGPURenderer,
} from "three/webgpu";
import { dFdx, dFdy, float, int, screenUV, texture, uniform, vec2, vec4 } from "three/tsl";
import { Filter, summed, targetOf } from "./targets";
import type { Depth } from "./surface";

const TILE = Number(CONSTANTS["RANGE_TILE"]);
/** Pixels of the first target on a tile's side. */
const STEPS = 2;
const NAME = "range";

type Bounded = Object3D & {
  readonly boundingSphere?: Sphere | null;
  readonly geometry?: { boundingSphere: Sphere | null; computeBoundingSphere(): void };
};

export class Range {
  readonly target: RenderTarget;
  /** Inverse of the nearest depth, and farthest depth, of every tile. */
  readonly tiles: RenderTarget;
  readonly #fill: Filter;
  readonly #size = uniform(new Vector2(1, 1));
  readonly #view = uniform(new Vector2(0, 0));
  readonly #sphere = new Sphere();
  readonly #centre = new Vector3();
  readonly mrt: MRTNode;
  /** Nearest and farthest depth of the fragment's tile. */
  readonly here: Node<"vec2">;

  /**
   * @param depth Of fragments.
   * @param canBlendFloats Whether the device blends targets of 32 bits; else ranges are wider by a step of half floats.
   */
  constructor(
    private readonly depth: Depth,
    canBlendFloats: boolean,
  ) {
    const type: TextureDataType = canBlendFloats ? FloatType : HalfFloatType;
    const widen = canBlendFloats ? 1e-6 : 2 ** -10;
    this.target = targetOf([{ name: NAME, format: RGFormat, type }]);
    this.tiles = targetOf([{ name: NAME, format: RGFormat, type }]);
    const z = depth.here;
    const reach = dFdx(z).abs().add(dFdy(z).abs()).div(2).min(z.div(20));
    const [near, far] = [z.sub(reach).max(1e-6), z.add(reach)];
    // Both are kept by maximum, of zeros.
    this.mrt = summed({ [NAME]: vec4(float(1).div(near).mul(1 + widen), far.mul(1 + widen), 0, 0) }, true);
    this.#fill = new Filter(this.#filled());
    const found = texture(this.tiles.texture, screenUV).level(int(0)).rg;
    this.here = vec2(float(1).div(found.x.max(1e-9)), found.y).toVar();
  }

  /** The range of a tile. */
  #filled(): Node<"vec4"> {
    const at = (x: number, y: number) =>
      texture(this.target.texture, screenUV.add(vec2(x, y).div(this.#size).div(STEPS))).level(int(0)).rg;
    const most = (from: number, to: number): Node<"vec2"> => {
      let found: Node<"vec2"> = vec2(0);
      for (let y = from; y < to; y++) for (let x = from; x < to; x++) found = found.max(at(x + 0.5, y + 0.5));
      return found.toVar();
    };
    const [own, around] = [most(-1, 1), most(-3, 3)];
    const some = around.y.greaterThan(0).select(around, this.#view);
    return vec4(own.y.greaterThan(0).select(own, some), 0, 0);
  }

  setSize(width: number, height: number): void {
    const [columns, rows] = [Math.ceil(width / TILE), Math.ceil(height / TILE)];
    this.target.setSize(STEPS * columns, STEPS * rows);
    this.tiles.setSize(columns, rows);
    this.#size.value.set(columns, rows);
  }

  /** Forgets the objects' bounds of the last frame. */
  begin(): void {
    this.#view.value.set(0, 0);
  }

  /** Takes an object's bounds into those of the view. */
  cover(object: Bounded, camera: Camera & { readonly near: number; readonly far: number }): void {
    const { geometry } = object;
    if (geometry && !geometry.boundingSphere) geometry.computeBoundingSphere();
    const sphere = object.boundingSphere ?? geometry?.boundingSphere;
    let [near, far] = [camera.near, camera.far];
    if (sphere && object.frustumCulled) {
      const { center, radius } = this.#sphere.copy(sphere).applyMatrix4(object.matrixWorld);
      const distance = -this.#centre.copy(center).applyMatrix4(camera.matrixWorldInverse).z;
      [near, far] = [Math.max(near, distance - radius), Math.min(far, distance + radius)];
    }
    const { value } = this.#view;
    value.set(Math.max(value.x, 1 / this.depth.of(near)), Math.max(value.y, this.depth.of(far)));
  }

  /** After the geometry: a range for every tile. */
  fill(renderer: WebGPURenderer): void {
    this.#fill.render(renderer, this.tiles);
  }

  dispose(): void {
    this.target.dispose();
    this.tiles.dispose();
    this.#fill.dispose();
  }
}
