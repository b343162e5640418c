// Whether the opaque objects hide a fragment: a write to storage is not kept out by a depth test, and targets that share
// the depth of another are cleared of it by three.js when they are new.

import type { Node, NodeBuilder, RenderTarget } from "three/webgpu";
import {
  cameraFar,
  cameraNear,
  float,
  Fn,
  int,
  positionView,
  screenUV,
  texture,
  viewZToLogarithmicDepth,
  viewZToOrthographicDepth,
  viewZToPerspectiveDepth,
  viewZToReversedOrthographicDepth,
  viewZToReversedPerspectiveDepth,
} from "three/tsl";
import { alpha } from "./surface";

/** Of a depth of the fixed functions, which is computed otherwise than here. */
const BIAS = 2 ** -22;

/** What decides how a depth buffer is filled. */
type Told = NodeBuilder & {
  readonly camera: { readonly isOrthographicCamera?: boolean };
  readonly renderer: { readonly reversedDepthBuffer: boolean; readonly logarithmicDepthBuffer: boolean };
};

export class Visible {
  readonly is: Node<"bool">;
  /** 1 for a fragment that is seen, else 0. */
  readonly share: Node<"float">;

  /** @param picture Has the depth of the opaque objects. */
  constructor(picture: RenderTarget) {
    const behind = texture(picture.depthTexture!, screenUV).level(int(0)).r;
    this.is = Fn((builder) => {
      if (!builder.material.depthTest) return alpha.greaterThan(0);
      const { renderer, camera } = builder as Told;
      const here = placed(renderer, camera.isOrthographicCamera === true)(positionView.z, cameraNear, cameraFar);
      const isNearest = renderer.reversedDepthBuffer
        ? here.greaterThanEqual(behind.sub(BIAS))
        : here.lessThanEqual(behind.add(BIAS));
      return alpha.greaterThan(0).and(isNearest);
    })().toVar();
    this.share = this.is.select(float(1), float(0)).toVar();
  }
}

function placed({ reversedDepthBuffer, logarithmicDepthBuffer }: Told["renderer"], isFlat: boolean) {
  if (isFlat) return reversedDepthBuffer ? viewZToReversedOrthographicDepth : viewZToOrthographicDepth;
  if (reversedDepthBuffer) return viewZToReversedPerspectiveDepth;
  return logarithmicDepthBuffer ? viewZToLogarithmicDepth : viewZToPerspectiveDepth;
}
