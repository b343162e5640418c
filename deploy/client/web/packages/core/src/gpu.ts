// The device, and what every pass needs of it.

import { Trouble } from "./trouble";

export type Resource = GPUBuffer | GPUTextureView | GPUSampler;

/** Limits of which all is asked for that there is; for the others the least that every device has is enough. */
const WANTED_LIMITS = ["maxStorageBufferBindingSize", "maxBufferSize", "maxTextureDimension2D"] as const;

export class Gpu {
  /** Whether float32 targets can be blended; else sums are half floats. */
  readonly blendsFloat32: boolean;
  readonly #pipelines = new Map<string, GPUComputePipeline>();

  private constructor(
    readonly device: GPUDevice,
    readonly description: string,
  ) {
    this.blendsFloat32 = device.features.has("float32-blendable");
  }

  /**
   * Asks the browser for a device.
   *
   * @throws Trouble There is none.
   */
  static async open(): Promise<Gpu> {
    if (!globalThis.isSecureContext) {
      throw new Trouble("Browsers offer WebGPU on secure pages only.", "Open this page by https, or as localhost.");
    }
    if (!navigator.gpu) {
      throw new Trouble(
        "This browser has no WebGPU.",
        "Use a current Chrome, Edge, Safari or Firefox; on Linux WebGPU may have to be switched on in its settings.",
      );
    }
    const adapter = await navigator.gpu.requestAdapter({ powerPreference: "high-performance" });
    if (!adapter) {
      throw new Trouble(
        "The browser has WebGPU, but no graphics adapter for it.",
        "Switch on hardware acceleration in the browser's settings, or update the graphics driver.",
      );
    }
    const requiredLimits: Record<string, number> = {};
    for (const name of WANTED_LIMITS) requiredLimits[name] = adapter.limits[name];
    const requiredFeatures = (["float32-blendable"] as const).filter((name) => adapter.features.has(name));
    const device = await adapter.requestDevice({ requiredFeatures, requiredLimits }).catch(() => {
      throw new Trouble("The browser has WebGPU, but cannot open the graphics device.", "Load the page again.");
    });
    const { vendor, architecture, description } = adapter.info;
    return new Gpu(device, description || [vendor, architecture].filter(Boolean).join(" ") || "unknown adapter");
  }

  /** A device that somebody else opened. */
  static of(device: GPUDevice): Gpu {
    return new Gpu(device, "a device that was opened elsewhere");
  }

  /** What sums with weights beyond half floats are blended into. */
  get sumFormat(): "rgba32float" | "rgba16float" {
    return this.blendsFloat32 ? "rgba32float" : "rgba16float";
  }

  /** The same with one component. */
  get scalarFormat(): "r32float" | "r16float" {
    return this.blendsFloat32 ? "r32float" : "r16float";
  }

  /**
   * A storage buffer of words, zero at first.
   *
   * @throws Trouble It would be larger than the device allows.
   */
  words(count: number): GPUBuffer {
    const size = 4 * Math.max(count, 1);
    const { maxStorageBufferBindingSize, maxBufferSize } = this.device.limits;
    fits(size, Math.min(maxStorageBufferBindingSize, maxBufferSize), "Make the window smaller, or the budget.");
    const { STORAGE, COPY_SRC, COPY_DST } = GPUBufferUsage;
    return this.device.createBuffer({ size, usage: STORAGE | COPY_SRC | COPY_DST });
  }

  /**
   * A buffer with a content.
   *
   * @throws Trouble It would be larger than the device allows.
   */
  filled(data: ArrayBufferView<ArrayBuffer>, usage: GPUBufferUsageFlags): GPUBuffer {
    const size = Math.ceil(Math.max(data.byteLength, 4) / 4) * 4;
    fits(size, this.device.limits.maxBufferSize, "Open a smaller scene.");
    const buffer = this.device.createBuffer({ size, usage: usage | GPUBufferUsage.COPY_DST, mappedAtCreation: true });
    const bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
    new Uint8Array(buffer.getMappedRange()).set(bytes);
    buffer.unmap();
    return buffer;
  }

  /** A compute pipeline, compiled once. */
  compute(code: string, entryPoint: string): GPUComputePipeline {
    const key = `${entryPoint}\n${code}`;
    let pipeline = this.#pipelines.get(key);
    if (!pipeline) {
      const module = this.device.createShaderModule({ code, label: entryPoint });
      pipeline = this.device.createComputePipeline({
        label: entryPoint,
        layout: "auto",
        compute: { module, entryPoint },
      });
      this.#pipelines.set(key, pipeline);
    }
    return pipeline;
  }

  /** The bind group of a compute pipeline; resources in the order of their bindings. */
  bind(pipeline: GPUComputePipeline, resources: readonly Resource[]): GPUBindGroup {
    return this.device.createBindGroup({ layout: pipeline.getBindGroupLayout(0), entries: entriesOf(resources) });
  }

  /** A whole buffer, read back. */
  async read(buffer: GPUBuffer): Promise<Uint32Array<ArrayBuffer>> {
    const { MAP_READ, COPY_DST } = GPUBufferUsage;
    const staging = this.device.createBuffer({ size: buffer.size, usage: MAP_READ | COPY_DST });
    const encoder = this.device.createCommandEncoder();
    encoder.copyBufferToBuffer(buffer, 0, staging, 0, buffer.size);
    this.device.queue.submit([encoder.finish()]);
    await staging.mapAsync(GPUMapMode.READ);
    const words = new Uint32Array(staging.getMappedRange().slice(0));
    staging.destroy();
    return words;
  }
}

function fits(size: number, most: number, remedy: string): void {
  if (size <= most) return;
  const [needed, allowed] = [Math.ceil(size / 2 ** 20), Math.floor(most / 2 ** 20)];
  throw new Trouble(`A buffer of ${needed} MiB is above this device's limit, ${allowed} MiB.`, remedy);
}

export function entriesOf(resources: readonly Resource[]): GPUBindGroupEntry[] {
  return resources.map((resource, binding) => ({
    binding,
    resource: resource instanceof GPUBuffer ? { buffer: resource } : resource,
  }));
}

/** Work groups for `threads` threads, 64 a group, in two dimensions: one dimension does not hold any picture. */
export function groupsFor(threads: number): [number, number] {
  const groups = Math.max(1, Math.ceil(threads / 64));
  const across = Math.min(groups, 1024);
  return [across, Math.ceil(groups / across)];
}
