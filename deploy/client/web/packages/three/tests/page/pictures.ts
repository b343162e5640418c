// Pictures as numbers, and how far they are apart.

import { DataUtils, type RenderTarget, WebGLCoordinateSystem, type WebGPURenderer } from "three/webgpu";

export interface Agreement {
  /** Share of pixels within 2 of 255, and root of the mean squared difference, in 255ths. */
  readonly within: number;
  readonly rmse: number;
  readonly most: number;
}

/** sRGB, 0 to 255. */
export const encode = (linear: number): number => {
  const x = Math.min(Math.max(linear, 0), 1);
  return 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
};

export const deviceOf = (renderer: WebGPURenderer): GPUDevice => (renderer.backend as unknown as { device: GPUDevice }).device;

/** Linear, three a pixel; rows from the top. */
export async function read(renderer: WebGPURenderer, target: RenderTarget): Promise<Float64Array> {
  const { width, height } = target;
  const halves = await renderer.readRenderTargetPixelsAsync(target, 0, 0, width, height);
  const isUp = renderer.coordinateSystem === WebGLCoordinateSystem;
  const made = new Float64Array(3 * width * height);
  for (let p = 0; p < width * height; p++) {
    const from = isUp ? (height - 1 - Math.floor(p / width)) * width + (p % width) : p;
    for (let c = 0; c < 3; c++) made[3 * p + c] = DataUtils.fromHalfFloat(halves[4 * from + c]!);
  }
  return made;
}

export function agreement(one: Float64Array, two: Float64Array): Agreement {
  let [within, squares, most] = [0, 0, 0];
  for (let p = 0; p < one.length; p += 3) {
    let apart = 0;
    for (let c = 0; c < 3; c++) {
      const difference = Math.abs(encode(one[p + c]!) - encode(two[p + c]!));
      squares += difference ** 2;
      apart = Math.max(apart, difference);
    }
    most = Math.max(most, apart);
    if (apart <= 2) within++;
  }
  return { within: within / (one.length / 3), rmse: Math.sqrt(squares / one.length), most };
}
