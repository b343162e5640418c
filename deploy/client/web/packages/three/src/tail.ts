// Sums of what stands for the fragments that no core has: a weighted mean of colours, and what is let through.

import { type MRTNode, type Node, RedFormat } from "three/webgpu";
import { int, screenUV, texture, vec4 } from "three/tsl";
import type { RenderTarget } from "three/webgpu";
import { colour, opticalDepth } from "./surface";
import { summed, targetOf } from "./targets";

export class Tail {
  readonly target: RenderTarget = targetOf([{ name: "mean" }, { name: "depth", format: RedFormat }]);

  /**
   * What a fragment adds.
   *
   * @param weight Of its colour.
   * @param share 0 where it is not the tail's, else 1.
   */
  mrt(weight: Node<"float">, share: Node<"float">): MRTNode {
    return summed({
      mean: vec4(colour, 1).mul(weight.mul(share)),
      depth: vec4(opticalDepth.mul(share), 0, 0, 0),
    });
  }

  /** Colour times coverage, and coverage, of a pixel. */
  get picture(): Node<"vec4"> {
    const [mean, depth] = this.target.textures.map((each) => texture(each, screenUV).level(int(0)));
    const covered = depth!.r.negate().exp().oneMinus();
    return vec4(mean!.rgb.div(mean!.a.max(1e-9)).mul(covered), covered);
  }
}
