// What every pass over transparent fragments reads of them. The shading is three.js's own.

import { CONSTANTS } from "@diaphane/core";
import { type Camera, type Material, type Node, NormalBlending, type OrthographicCamera } from "three/webgpu";
import { Fn, output, positionView, uniform, vec3 } from "three/tsl";

const MOST_OPACITY = Number(CONSTANTS["MOST_OPACITY"]);

/** A material as far as it decides who draws it; nodes of transmission and backdrop are of single kinds of material. */
type Deciding = Material & {
  readonly transmission?: number;
  readonly transmissionNode?: object | null;
  readonly backdropNode?: object | null;
};

/** Whether the pass composites a material; all others are three.js's, beneath. */
export function isOurs(material: Material): boolean {
  return material.transparent && material.blending === NormalBlending && !transmits(material);
}

/** Whether a material reads what is behind it, so that it cannot be drawn apart from that. */
export function transmits(material: Material): boolean {
  const { transmission, transmissionNode, backdropNode } = material as Deciding;
  return (transmission ?? 0) > 0 || Boolean(transmissionNode) || Boolean(backdropNode);
}

/** Opacity of a fragment, in [0, 1]. */
export const alpha = output.a.clamp(0, 1).toVar();

/** Linear colour of a fragment, straight. */
export const colour: Node<"vec3"> = Fn((builder) =>
  builder.material.premultipliedAlpha ? output.rgb.div(output.a.max(1e-6)) : vec3(output.rgb),
)();

/** Optical depth of a fragment, up to what is behind it cannot be seen. */
export const opticalDepth = alpha.oneMinus().max(Math.exp(-MOST_OPACITY)).log().negate().toVar();

/** Depths of a view in units of its own: the geometric mean of where it begins and ends, so that half floats do. */
export class Depth {
  readonly #offset = uniform(0);
  readonly #unit = uniform(1);

  /** Of a fragment: > 0, growing from the camera on. */
  readonly here: Node<"float"> = positionView.z.negate().add(this.#offset).div(this.#unit).max(1e-6).toVar();

  /** A distance along the view axis in these units. */
  of(distance: number): number {
    return Math.max((distance + this.#offset.value) / this.#unit.value, 1e-6);
  }

  update(camera: Camera & Pick<OrthographicCamera, "near" | "far">): void {
    const { near, far } = camera;
    // An orthographic camera may begin at or behind its own place.
    const isFlat = (camera as Partial<OrthographicCamera>).isOrthographicCamera === true;
    this.#offset.value = isFlat ? (far - near) / 1024 - near : 0;
    this.#unit.value = Math.sqrt((near + this.#offset.value) * (far + this.#offset.value));
  }
}
