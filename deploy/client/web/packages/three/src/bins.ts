// Depth bins of a pixel in targets that are added to, and the weights that follow (METHOD.md section 2, `binned-8`).
// Units and moments are whole numbers: half floats add them exactly, in any order, as long as a bin has no more than
// 2,048 units, an optical depth of 8, behind which 0.03 % are visible.

import { CONSTANTS, TAILS } from "@diaphane/core";
import type { Node, RenderTarget } from "three/webgpu";
import { float, int, screenUV, texture, vec4 } from "three/tsl";
import { alpha, opticalDepth } from "./surface";
import { targetOf } from "./targets";

const [UNIT, ROOT, PLAIN, MOST_EXPONENT, LEAST_OTHERS, LEAST_SPREAD] = [
  "OPTICAL_UNIT",
  "ROOT_SHARE",
  "PLAIN_SHARE",
  "MAX_EXPONENT",
  "LEAST_OTHERS",
  "LEAST_SPREAD",
].map((name) => Number(CONSTANTS[name])) as [number, number, number, number, number, number];
/** Of the tail with the fewest that have means: those that four targets hold. */
const BINS = Math.min(...Object.values(TAILS).flatMap(({ bins, meanLevels }) => (meanLevels > 0 ? [bins] : [])));
const MOST_UNITS = 2048;
const FOURS = Array.from({ length: BINS / 4 }, (_, i) => i);

export class Bins {
  readonly target: RenderTarget;
  readonly #bin: Node<"float">;
  readonly #within: Node<"float">;
  readonly #moments: Node<"float">;
  readonly #units: Node<"float">;

  /** @param depth And the range of depths, of a fragment. */
  constructor(depth: Node<"float">, range: Node<"vec2">) {
    this.target = targetOf([...FOURS.map((i) => ({ name: `units${i}` })), ...FOURS.map((i) => ({ name: `moments${i}` }))]);
    const extent = range.y.sub(range.x);
    const x = extent.greaterThan(0).select(depth.sub(range.x).div(extent.max(1e-12)).clamp(0, 1), float(0));
    const place = x.mul(PLAIN).add(x.sqrt().mul(ROOT)).mul(BINS).toVar();
    this.#bin = place.floor().min(BINS - 1).toVar();
    this.#within = place.sub(this.#bin).toVar();
    this.#units = alpha.greaterThan(0).select(opticalDepth.mul(UNIT).add(0.5).floor().clamp(1, MOST_UNITS), float(0)).toVar();
    this.#moments = this.#units.mul(this.#within).add(0.5).floor().toVar();
  }

  /**
   * What a fragment adds to its bin.
   *
   * @param share 0 where the fragment is hidden, else 1.
   */
  outputs(share: Node<"float">): Record<string, Node> {
    const outputs: Record<string, Node> = {};
    for (const i of FOURS) {
      outputs[`units${i}`] = this.#own(i).mul(this.#units).mul(share);
      outputs[`moments${i}`] = this.#own(i).mul(this.#moments).mul(share);
    }
    return outputs;
  }

  /** A fragment's weight in the mean colour of its pixel: its opacity, times what is visible where it lies. */
  get weight(): Node<"float"> {
    const sum = (kind: string, share: (i: number) => Node<"vec4">): Node<"float"> =>
      FOURS.map((i) => this.#kept(`${kind}${i}`).dot(share(i)))
        .reduce((one, two) => one.add(two))
        .toVar();
    const before = sum("units", (i) => this.#before(i)).div(UNIT);
    const all = sum("units", (i) => this.#own(i)).div(UNIT);
    const moment = sum("moments", (i) => this.#own(i)).div(UNIT);
    const others = all.sub(opticalDepth).max(0).toVar();
    const mean = moment.sub(opticalDepth.mul(this.#within)).div(others.max(LEAST_OTHERS)).clamp(0, 1);
    const middle = others.greaterThan(LEAST_OTHERS).select(mean, float(0.5)).toVar();
    const spread = middle.min(middle.oneMinus()).max(LEAST_SPREAD).toVar();
    const passed = this.#within.sub(middle).add(spread).div(spread.mul(2)).clamp(0, 1);
    return alpha.mul(before.add(others.mul(passed)).min(MOST_EXPONENT).negate().exp());
  }

  #kept(name: string): Node<"vec4"> {
    return texture(this.target.textures.find((each) => each.name === name)!, screenUV).level(int(0));
  }

  /** 1 for the fragment's own of four bins. */
  #own(i: number): Node<"vec4"> {
    return this.#fours(i).sub(this.#bin).abs().oneMinus().clamp(0, 1);
  }

  /** 1 for those of four bins that are in front of the fragment's own. */
  #before(i: number): Node<"vec4"> {
    return vec4(this.#bin).sub(this.#fours(i)).clamp(0, 1);
  }

  #fours(i: number): Node<"vec4"> {
    return vec4(4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3);
  }
}
