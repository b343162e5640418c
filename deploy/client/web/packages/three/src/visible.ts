// Whether the opaque objects hide a fragment: a write to storage is not kept out by a depth test.

import type { Node, RenderTarget } from "three/webgpu";
import {
  cameraFar,
  cameraNear,
  float,
  Fn,
  int,
  positionView,
  screenUV,
  texture,
  viewZToOrthographicDepth,
  viewZToPerspectiveDepth,
} from "three/tsl";
import { alpha } from "./surface";

/** Of a depth of the fixed functions, which is computed otherwise than here. */
const BIAS = 2 ** -22;

export class Visible {
  readonly is: Node<"bool">;
  /** 1 for a fragment that is seen, else 0. */
  readonly share: Node<"float">;

  /** @param picture Has the depth of the opaque objects. */
  constructor(picture: RenderTarget) {
    const behind = texture(picture.depthTexture!, screenUV).level(int(0)).r;
    this.is = Fn((builder) => {
      if (!builder.material.depthTest) return alpha.greaterThan(0);
      const isFlat = (builder.camera as { isOrthographicCamera?: boolean }).isOrthographicCamera === true;
      const placed = isFlat ? viewZToOrthographicDepth : viewZToPerspectiveDepth;
      const here = placed(positionView.z, cameraNear, cameraFar);
      return alpha.greaterThan(0).and(here.lessThanEqual(behind.add(BIAS)));
    })().toVar();
    this.share = this.is.select(float(1), float(0)).toVar();
  }
}
