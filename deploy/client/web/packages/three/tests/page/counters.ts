// What the device was asked for: pipelines that were made, and buffers and textures that were not given back.

const TEXEL_BYTES: Readonly<Record<string, number>> = {
  r8unorm: 1,
  r16float: 2,
  rgba8unorm: 4,
  "rgba8unorm-srgb": 4,
  bgra8unorm: 4,
  r32float: 4,
  depth24plus: 4,
  depth32float: 4,
  rg16float: 4,
  rgba16float: 8,
  rg32float: 8,
  rgba32float: 16,
};

/** Of a device, as it stands. */
export interface Held {
  readonly pipelines: number;
  readonly buffers: number;
  readonly textures: number;
  readonly bytes: number;
  readonly passes: number;
}

const live = new Set<GPUBuffer | GPUTexture>();
let [pipelines, passes] = [0, 0];

export function held(): Held {
  let [buffers, bytes] = [0, 0];
  for (const each of live) {
    if (each instanceof GPUBuffer) {
      buffers++;
      bytes += each.size;
    } else {
      const texels = each.width * each.height * each.depthOrArrayLayers * each.sampleCount;
      bytes += texels * (TEXEL_BYTES[each.format] ?? NaN);
    }
  }
  return { pipelines, buffers, textures: live.size - buffers, bytes, passes };
}

/** Begins to count. */
export function count(): void {
  if (!("GPUDevice" in globalThis)) return;
  const after = <T extends object, K extends keyof T>(prototype: T, name: K, then: (made: never, on: never) => void) => {
    const before = prototype[name] as unknown as (...all: unknown[]) => unknown;
    prototype[name] = function (this: T, ...all: unknown[]) {
      const made = before.apply(this, all);
      then(made as never, this as never);
      return made;
    } as unknown as T[K];
  };
  for (const name of ["createBuffer", "createTexture"] as const)
    after(GPUDevice.prototype, name, (made: GPUBuffer | GPUTexture) => void live.add(made));
  for (const name of ["createRenderPipeline", "createRenderPipelineAsync", "createComputePipeline"] as const)
    after(GPUDevice.prototype, name, () => void pipelines++);
  for (const name of ["beginRenderPass", "beginComputePass"] as const)
    after(GPUCommandEncoder.prototype, name, () => void passes++);
  for (const { prototype } of [GPUBuffer, GPUTexture])
    after(prototype as GPUBuffer, "destroy", (_, on: GPUBuffer) => void live.delete(on));
}
