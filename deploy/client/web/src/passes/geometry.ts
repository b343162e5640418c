// A scene on the GPU, and its geometry passes: one vertex shader, so that depth is the same in all of them.

import { type Gpu, type Resource, entriesOf } from "../gpu";
import type { Batch, Image, Layer, Scene } from "../scene";
import { shader } from "../shaders";
import { Trouble } from "../trouble";

export const DEPTH: GPUTextureFormat = "depth32float";
export const BACKGROUND: GPUTextureFormat = "rgba8unorm";

const VERTEX_BUFFERS: GPUVertexBufferLayout[] = (
  [
    [12, "float32x3"],
    [12, "float32x3"],
    [8, "float32x2"],
    [4, "unorm8x4"],
  ] as const
).map(([arrayStride, format], shaderLocation) => ({
  arrayStride,
  attributes: [{ format, offset: 0, shaderLocation }],
}));

const BLEND: GPUBlendState = {
  color: { srcFactor: "one", dstFactor: "one", operation: "add" },
  alpha: { srcFactor: "one", dstFactor: "one", operation: "add" },
};

/** A pass over the transparent triangles. */
export interface Pass {
  /** Files of `shaders/` in front of `surface` and after it; the last one has the entry point. */
  readonly files: readonly string[];
  readonly entryPoint: string;
  /** Storage buffers in the order of their bindings: whether a shader writes them. */
  readonly writes: readonly boolean[];
  /** Formats of the targets that it adds to. */
  readonly targets: readonly GPUTextureFormat[];
}

interface Drawn {
  readonly batch: Batch;
  readonly look: GPUBindGroup;
}

export class Geometry {
  readonly #camera: GPUBuffer;
  readonly #buffers: GPUBuffer[];
  readonly #indices: GPUBuffer;
  readonly #textures: GPUTexture[];
  readonly #drawn: Drawn[];
  readonly #layouts: { camera: GPUBindGroupLayout; frame: GPUBindGroupLayout; look: GPUBindGroupLayout };
  readonly #pipelines = new Map<string, GPURenderPipeline>();

  constructor(
    readonly gpu: Gpu,
    readonly scene: Scene,
  ) {
    const { device } = gpu;
    const { VERTEX, INDEX, UNIFORM } = GPUBufferUsage;
    this.#buffers = [scene.positions, scene.normals, scene.uvs, scene.colours].map((data) => gpu.filled(data, VERTEX));
    this.#indices = gpu.filled(scene.indices, INDEX);
    this.#camera = gpu.filled(new Uint8Array(176), UNIFORM);
    const both = GPUShaderStage.VERTEX | GPUShaderStage.FRAGMENT;
    const visibility = GPUShaderStage.FRAGMENT;
    const camera: GPUBindGroupLayoutEntry = { binding: 0, visibility: both, buffer: { type: "uniform" } };
    const depth: GPUBindGroupLayoutEntry = { binding: 1, visibility, texture: { sampleType: "depth" } };
    this.#layouts = {
      camera: device.createBindGroupLayout({ entries: [camera] }),
      frame: device.createBindGroupLayout({ entries: [camera, depth] }),
      look: device.createBindGroupLayout({
        entries: [
          { binding: 0, visibility, buffer: { type: "uniform" } },
          { binding: 1, visibility, texture: {} },
          { binding: 2, visibility, sampler: {} },
        ],
      }),
    };
    const textures = new Map<Image | null, GPUTexture>();
    this.#drawn = scene.batches.map((batch) => {
      if (!textures.has(batch.image)) textures.set(batch.image, upload(gpu, batch.image));
      return { batch, look: this.#look(batch, textures.get(batch.image)!.createView()) };
    });
    this.#textures = [...textures.values()];
  }

  /** Gives back what the scene takes. */
  destroy(): void {
    for (const each of [...this.#buffers, this.#indices, this.#camera, ...this.#textures]) each.destroy();
  }

  /** Moves the camera; `block` is `cameraBlock`'s. */
  look(block: ArrayBuffer): void {
    this.gpu.device.queue.writeBuffer(this.#camera, 0, block);
  }

  /** Draws the opaque surfaces. */
  drawOpaque(encoder: GPUCommandEncoder, background: GPUTexture, depth: GPUTexture, clear: GPUColor): void {
    const pipeline = this.#pipeline("opaque", () => ({
      layout: [this.#layouts.camera, this.#layouts.look],
      files: ["surface", "opaque"],
      entryPoint: "opaque_colour",
      targets: [{ format: BACKGROUND }],
      depth: { format: DEPTH, depthWriteEnabled: true, depthCompare: "less" },
    }));
    const pass = encoder.beginRenderPass({
      colorAttachments: [{ view: background.createView(), loadOp: "clear", storeOp: "store", clearValue: clear }],
      depthStencilAttachment: {
        view: depth.createView(),
        depthLoadOp: "clear",
        depthStoreOp: "store",
        depthClearValue: 1,
      },
    });
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, this.#group(this.#layouts.camera, [this.#camera]));
    this.#draw(pass, ["opaque", "mixed"]);
  }

  /**
   * Runs a pass over the transparent triangles.
   *
   * @param depth Of the opaque surfaces.
   * @param buffers Bound to group 2, in order.
   * @param targets Cleared to zero, then added to.
   */
  drawTransparent(
    encoder: GPUCommandEncoder,
    what: Pass,
    bins: number,
    depth: GPUTexture,
    buffers: readonly GPUBuffer[],
    targets: readonly GPUTexture[] = [],
  ): void {
    const pipeline = this.#pipeline(`${what.entryPoint} ${bins} ${what.targets.join()}`, () => ({
      layout: [this.#layouts.frame, this.#layouts.look, this.#storage(what.writes)],
      files: ["surface", ...what.files],
      bins,
      entryPoint: what.entryPoint,
      targets: what.targets.map((format) => ({ format, blend: BLEND })),
      // The shader tests by itself. The attachment is there since a pass needs one.
      depth: { format: DEPTH, depthWriteEnabled: false, depthCompare: "always" },
    }));
    const pass = encoder.beginRenderPass({
      colorAttachments: targets.map((target) => ({ view: target.createView(), loadOp: "clear", storeOp: "store" })),
      depthStencilAttachment: { view: depth.createView(), depthReadOnly: true },
    });
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, this.#group(this.#layouts.frame, [this.#camera, depth.createView()]));
    pass.setBindGroup(2, this.#group(pipeline.getBindGroupLayout(2), buffers));
    this.#draw(pass, ["mixed", "transparent"]);
  }

  #draw(pass: GPURenderPassEncoder, layers: readonly Layer[]): void {
    this.#buffers.forEach((buffer, slot) => pass.setVertexBuffer(slot, buffer));
    pass.setIndexBuffer(this.#indices, "uint32");
    for (const { batch, look } of this.#drawn) {
      if (!layers.includes(batch.layer)) continue;
      pass.setBindGroup(1, look);
      pass.drawIndexed(batch.count, 1, batch.first);
    }
    pass.end();
  }

  #group(layout: GPUBindGroupLayout, resources: readonly Resource[]): GPUBindGroup {
    return this.gpu.device.createBindGroup({ layout, entries: entriesOf(resources) });
  }

  #storage(writes: readonly boolean[]): GPUBindGroupLayout {
    return this.gpu.device.createBindGroupLayout({
      entries: writes.map((each, binding) => ({
        binding,
        visibility: GPUShaderStage.FRAGMENT,
        buffer: { type: each ? "storage" : "read-only-storage" },
      })),
    });
  }

  #look(batch: Batch, texture: GPUTextureView): GPUBindGroup {
    const block = new ArrayBuffer(32);
    new Float32Array(block).set([...batch.scale, batch.threshold]);
    new Uint32Array(block)[5] = batch.layer === "opaque" ? 1 : 0;
    const [addressModeU, addressModeV] = batch.image?.wrap ?? ["repeat", "repeat"];
    const sampler = this.gpu.device.createSampler({
      addressModeU,
      addressModeV,
      magFilter: "linear",
      minFilter: "linear",
      mipmapFilter: "linear",
    });
    const material = this.gpu.filled(new Uint8Array(block), GPUBufferUsage.UNIFORM);
    return this.#group(this.#layouts.look, [material, texture, sampler]);
  }

  #pipeline(
    key: string,
    describe: () => {
      layout: GPUBindGroupLayout[];
      files: string[];
      bins?: number;
      entryPoint: string;
      targets: GPUColorTargetState[];
      depth: GPUDepthStencilState;
    },
  ): GPURenderPipeline {
    let made = this.#pipelines.get(key);
    if (!made) {
      const { layout, files, bins, entryPoint, targets, depth } = describe();
      const { device } = this.gpu;
      const module = device.createShaderModule({ code: shader(files, bins), label: entryPoint });
      made = device.createRenderPipeline({
        label: entryPoint,
        layout: device.createPipelineLayout({ bindGroupLayouts: layout }),
        vertex: { module, entryPoint: "place", buffers: VERTEX_BUFFERS },
        fragment: { module, entryPoint, targets },
        primitive: { topology: "triangle-list", cullMode: "none" },
        depthStencil: depth,
      });
      this.#pipelines.set(key, made);
    }
    return made;
  }
}

/** An image with its mipmaps; none is one white texel. */
function upload(gpu: Gpu, image: Image | null): GPUTexture {
  const { device } = gpu;
  const [width, height] = image ? [image.pixels.width, image.pixels.height] : [1, 1];
  const most = device.limits.maxTextureDimension2D;
  if (Math.max(width, height) > most) {
    throw new Trouble(`An image of ${width} × ${height} is above this device's limit, ${most}.`, "Make it smaller.");
  }
  const texture = device.createTexture({
    size: [width, height],
    format: "rgba8unorm-srgb",
    mipLevelCount: 1 + Math.floor(Math.log2(Math.max(width, height))),
    usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST | GPUTextureUsage.RENDER_ATTACHMENT,
  });
  if (!image) {
    device.queue.writeTexture({ texture }, new Uint8Array([255, 255, 255, 255]), {}, [1, 1]);
    return texture;
  }
  device.queue.copyExternalImageToTexture({ source: image.pixels }, { texture }, [width, height]);
  const module = device.createShaderModule({ code: shader(["mipmap"]) });
  const pipeline = device.createRenderPipeline({
    layout: "auto",
    vertex: { module, entryPoint: "cover" },
    fragment: { module, entryPoint: "halve", targets: [{ format: texture.format }] },
  });
  const sampler = device.createSampler({ minFilter: "linear", magFilter: "linear" });
  const encoder = device.createCommandEncoder();
  for (let level = 1; level < texture.mipLevelCount; ++level) {
    const view = (baseMipLevel: number): GPUTextureView => texture.createView({ baseMipLevel, mipLevelCount: 1 });
    const pass = encoder.beginRenderPass({
      colorAttachments: [{ view: view(level), loadOp: "clear", storeOp: "store" }],
    });
    pass.setPipeline(pipeline);
    const layout = pipeline.getBindGroupLayout(0);
    pass.setBindGroup(0, device.createBindGroup({ layout, entries: entriesOf([view(level - 1), sampler]) }));
    pass.draw(3);
    pass.end();
  }
  device.queue.submit([encoder.finish()]);
  return texture;
}
