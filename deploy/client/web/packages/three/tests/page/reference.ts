// The picture that is right: fragments as three.js shades them, peeled layer by layer and composited front to back in
// float64.

import { Color, FloatType, NearestFilter, RenderTarget, type WebGPURenderer } from "three/webgpu";
import { Discard, Fn, If, int, mrt, output, positionView, screenUV, texture, vec4 } from "three/tsl";
import type { Sample } from "./scenes";

export interface Reference {
  /** Linear, straight, row 0 at the top; three a pixel. */
  readonly picture: Float64Array;
  /** Fragments of every pixel. */
  readonly counts: Uint32Array;
}

function layers(width: number, height: number): RenderTarget {
  const made = new RenderTarget(width, height, { count: 2, type: FloatType, samples: 0 });
  made.textures.forEach((each, i) => {
    each.name = i ? "place" : "colour";
    each.minFilter = each.magFilter = NearestFilter;
  });
  return made;
}

/** Deeper than anything: what a pixel keeps once its layers are peeled, so that they are not peeled again. */
const BEYOND = 1e9;
/** Layers that are looked for. */
const MOST = 80;

/** Peels a scene; its transparent materials have to be of `NormalBlending`. */
export async function peel(renderer: WebGPURenderer, { scene, camera }: Sample, width: number, height: number): Promise<Reference> {
  const read = async (from: RenderTarget, index: number): Promise<Float32Array> =>
    (await renderer.readRenderTargetPixelsAsync(from, 0, 0, width, height, index)) as Float32Array;
  const opaque = new RenderTarget(width, height, { type: FloatType, samples: 0 });
  renderer.transparent = false;
  renderer.setRenderTarget(opaque);
  renderer.render(scene, camera);
  const behind = await read(opaque, 0);
  renderer.transparent = true;

  const targets = [layers(width, height), layers(width, height)] as const;
  const peeled = targets.map((_, i) => {
    const before = texture(targets[1 - i]!.textures[1]!, screenUV).level(int(0)).r;
    const place = Fn((builder) => {
      if (!builder.material.transparent) return vec4(BEYOND, 0, 0, 0);
      If(positionView.z.negate().lessThanEqual(before), () => void Discard());
      return vec4(positionView.z.negate(), 1, 0, 0);
    })();
    return mrt({ place, colour: vec4(output.rgb, output.a.clamp(0, 1)) })
      .setClearColor("place", new Color(BEYOND, 0, 0), 0)
      .setClearColor("colour", 0x000000, 0);
  });
  const none = mrt({ place: vec4(0), colour: vec4(0) }).setClearColor("place", 0x000000, 0);
  const { background } = scene;
  const picture = new Float64Array(3 * width * height);
  const seen = new Float64Array(width * height).fill(1);
  const counts = new Uint32Array(width * height);
  renderer.setRenderTarget(targets[1]);
  renderer.setMRT(none);
  renderer.setRenderObjectFunction(() => undefined);
  scene.background = null;
  renderer.render(scene, camera); // nothing: depth 0 everywhere
  for (let turn = 0; turn < MOST; turn++) {
    const target = targets[turn % 2]!;
    renderer.setRenderTarget(target);
    renderer.setMRT(peeled[turn % 2]!);
    renderer.setRenderObjectFunction((object, s, c, geometry, material, ...rest) => {
      const { depthWrite } = material;
      material.depthWrite = true;
      renderer.renderObject(object, s, c, geometry, material, ...rest);
      material.depthWrite = depthWrite;
    });
    renderer.render(scene, camera);
    const [colours, places] = [await read(target, 0), await read(target, 1)];
    let found = 0;
    for (let p = 0; p < width * height; p++) {
      if (!places[4 * p + 1]) continue;
      found++;
      counts[p]!++;
      const a = colours[4 * p + 3]!;
      for (let c = 0; c < 3; c++) picture[3 * p + c]! += seen[p]! * a * colours[4 * p + c]!;
      seen[p]! *= 1 - a;
    }
    if (!found) break;
  }
  for (let p = 0; p < width * height; p++)
    for (let c = 0; c < 3; c++) picture[3 * p + c]! += seen[p]! * behind[4 * p + c]!;
  renderer.setMRT(null);
  renderer.setRenderTarget(null);
  renderer.setRenderObjectFunction(null);
  scene.background = background;
  for (const each of [opaque, ...targets]) each.dispose();
  return { picture, counts };
}
