// A scene on the GPU, and its geometry passes: one vertex shader, so that depth is the same in all of them.

import { type Gpu, type Resource, entriesOf, groupsFor } from "../gpu";
import type { Batch, Layer, Scene } from "../scene";
import { shader } from "../shaders";
import type { Tail } from "../tail";
import { Trouble } from "../trouble";
import { Work } from "../work";

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

const CAMERA_BYTES = 176;
/** Where in it the projection is, column by column. */
const PROJECTION = 16;

/** A pass over the transparent triangles. */
export interface Pass {
  /** Files of `shaders/` in front of `surface` and after it; the last one has the entry point. */
  readonly files: readonly string[];
  readonly entryPoint: string;
  /** Storage buffers in the order of their bindings: whether a shader writes them. */
  readonly writes: readonly boolean[];
  /** Of the shaders. */
  readonly tail?: Tail;
}

/** Triangles whose area is added up together, and pixels that are drawn at most without giving the GPU back. */
const TOGETHER = 64;
const MOST_AT_ONCE = 2 ** 24;
/** Pixels that the triangles of a view may cover, again and again. */
const MOST_COVERED = 2 ** 28;

/** Indices from `first` to `end`. */
interface Run {
  readonly first: number;
  readonly end: number;
}

interface Drawn {
  readonly batch: Batch;
  readonly look: GPUBindGroup;
}

export class Geometry {
  readonly #camera: GPUBuffer;
  /** The same view at a fraction of the resolution. */
  readonly #coarseCamera: GPUBuffer;
  readonly #buffers: GPUBuffer[];
  readonly #indices: GPUBuffer;
  readonly #textures: GPUTexture[];
  readonly #drawn: Drawn[];
  readonly #layouts: { camera: GPUBindGroupLayout; frame: GPUBindGroupLayout; look: GPUBindGroupLayout };
  readonly #pipelines = new Map<string, GPURenderPipeline>();
  /** The triangles of this view in runs that take about as long. */
  #runs: readonly Run[] = [];

  constructor(
    readonly gpu: Gpu,
    readonly scene: Scene,
  ) {
    const { device } = gpu;
    const { VERTEX, INDEX, UNIFORM, STORAGE } = GPUBufferUsage;
    const { positions, normals, uvs, colours } = scene;
    this.#buffers = [
      gpu.filled(positions, VERTEX | STORAGE),
      ...[normals, uvs, colours].map((data) => gpu.filled(data, VERTEX)),
    ];
    this.#indices = gpu.filled(scene.indices, INDEX | STORAGE);
    this.#camera = gpu.filled(new Uint8Array(CAMERA_BYTES), UNIFORM);
    this.#coarseCamera = gpu.filled(new Uint8Array(CAMERA_BYTES), UNIFORM);
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
    const textures = new Map<ImageBitmap | null, GPUTexture>();
    this.#drawn = scene.batches.map((batch) => {
      const pixels = batch.image?.pixels ?? null; // of one image there may be many looks
      if (!textures.has(pixels)) textures.set(pixels, upload(gpu, pixels));
      return { batch, look: this.#look(batch, textures.get(pixels)!.createView()) };
    });
    this.#textures = [...textures.values()];
  }

  /** Gives back what the scene takes. */
  destroy(): void {
    const own = [...this.#buffers, this.#indices, this.#camera, this.#coarseCamera, ...this.#textures];
    for (const each of own) each.destroy();
  }

  /** Whether drawing this view once takes so long that there are pauses. */
  get isSlow(): boolean {
    return this.#runs.length > 1;
  }

  /**
   * Moves the camera, and looks how much there is to draw from there.
   *
   * @param block Of `cameraBlock`.
   * @param share Width and height of the picture as shares of what `drawCoarse` draws.
   * @param pixels Of the window.
   * @throws Trouble It is too much for a page that has to stay usable.
   */
  async look(block: ArrayBuffer, share: readonly [number, number], pixels: number): Promise<void> {
    this.gpu.device.queue.writeBuffer(this.#camera, 0, block);
    this.gpu.device.queue.writeBuffer(this.#coarseCamera, 0, widened(block, share));
    const areas = await this.#areas();
    const sum = areas.reduce((one, two) => one + two, 0);
    const covered = Number.isNaN(sum) ? Infinity : sum;
    if (covered > MOST_COVERED) {
      const [times, most] = [covered, MOST_COVERED].map((each) => Math.floor(each / pixels).toLocaleString("en"));
      throw new Trouble(
        `The surfaces cover the picture ${times} times over; at this size, ${most} times can be drawn here.`,
        "Look from elsewhere, make the window smaller, or open a simpler scene.",
      );
    }
    this.#runs = runsOf(areas, this.scene.indices.length);
  }

  /** Draws the opaque surfaces. */
  async drawOpaque(work: Work, background: GPUTexture, depth: GPUTexture, clear: GPUColor): Promise<void> {
    const pipeline = this.#pipeline(shader(["camera", "surface", "opaque"]), "opaque_colour", () => ({
      layout: [this.#layouts.camera, this.#layouts.look],
      targets: [{ format: BACKGROUND }],
      depth: { format: DEPTH, depthWriteEnabled: true, depthCompare: "less" },
    }));
    await this.#draw(work, ["opaque", "mixed"], (loadOp) => {
      const pass = work.encoder.beginRenderPass({
        colorAttachments: [{ view: background.createView(), loadOp, storeOp: "store", clearValue: clear }],
        depthStencilAttachment: {
          view: depth.createView(),
          depthLoadOp: loadOp,
          depthStoreOp: "store",
          depthClearValue: 1,
        },
      });
      pass.setPipeline(pipeline);
      pass.setBindGroup(0, this.#group(this.#layouts.camera, [this.#camera]));
      return pass;
    });
  }

  /**
   * Runs a pass over the transparent triangles.
   *
   * @param depth Of the opaque surfaces.
   * @param buffers Bound to group 2, in order.
   * @param targets Cleared to zero, then added to.
   */
  async drawTransparent(
    work: Work,
    what: Pass,
    depth: GPUTexture,
    buffers: readonly GPUBuffer[],
    targets: readonly GPUTexture[] = [],
  ): Promise<void> {
    const code = shader(["camera", "surface", ...what.files], what.tail);
    const pipeline = this.#pipeline(code, what.entryPoint, () => ({
      layout: [this.#layouts.frame, this.#layouts.look, this.#storage(what.writes)],
      targets: targets.map(({ format }) => ({ format, blend: BLEND })),
      // The shader tests by itself. The attachment is there since a pass needs one.
      depth: { format: DEPTH, depthWriteEnabled: false, depthCompare: "always" },
    }));
    await this.#draw(work, ["mixed", "transparent"], (loadOp) => {
      const pass = work.encoder.beginRenderPass({
        colorAttachments: targets.map((target) => ({ view: target.createView(), loadOp, storeOp: "store" })),
        depthStencilAttachment: { view: depth.createView(), depthReadOnly: true },
      });
      pass.setPipeline(pipeline);
      pass.setBindGroup(0, this.#group(this.#layouts.frame, [this.#camera, depth.createView()]));
      pass.setBindGroup(2, this.#group(pipeline.getBindGroupLayout(2), buffers));
      return pass;
    });
  }

  /**
   * Runs a pass over the transparent triangles at a fraction of the resolution, also those that something hides.
   *
   * @param target What is drawn into: nothing is.
   * @param buffer The one storage buffer.
   */
  async drawCoarse(work: Work, what: Pass, target: GPUTexture, buffer: GPUBuffer): Promise<void> {
    const pipeline = this.#pipeline(shader(["camera", "surface", ...what.files]), what.entryPoint, () => ({
      layout: [this.#layouts.camera, this.#layouts.look, this.#storage(what.writes)],
      targets: [{ format: target.format, writeMask: 0 }],
    }));
    await this.#draw(work, ["mixed", "transparent"], (loadOp) => {
      const pass = work.encoder.beginRenderPass({
        colorAttachments: [{ view: target.createView(), loadOp, storeOp: "discard" }],
      });
      pass.setPipeline(pipeline);
      pass.setBindGroup(0, this.#group(this.#layouts.camera, [this.#coarseCamera]));
      pass.setBindGroup(2, this.#group(pipeline.getBindGroupLayout(2), [buffer]));
      return pass;
    });
  }

  /** Draws the triangles of some layers run by run, with a pause after each but the last. */
  async #draw(
    work: Work,
    layers: readonly Layer[],
    begin: (loadOp: GPULoadOp) => GPURenderPassEncoder,
  ): Promise<void> {
    for (const [i, run] of this.#runs.entries()) {
      if (i > 0) await work.pause();
      const pass = begin(i > 0 ? "load" : "clear");
      this.#buffers.forEach((buffer, slot) => pass.setVertexBuffer(slot, buffer));
      pass.setIndexBuffer(this.#indices, "uint32");
      for (const { batch, look } of this.#drawn) {
        const [first, end] = [Math.max(batch.first, run.first), Math.min(batch.first + batch.count, run.end)];
        if (!layers.includes(batch.layer) || end <= first) continue;
        pass.setBindGroup(1, look);
        pass.drawIndexed(end - first, 1, first);
      }
      pass.end();
    }
  }

  /** Pixels that each `TOGETHER` triangles cover from where the camera is. */
  async #areas(): Promise<Float32Array> {
    const groups = Math.ceil(this.scene.indices.length / (3 * TOGETHER));
    const areas = this.gpu.words(groups);
    const work = new Work(this.gpu);
    const pipeline = this.gpu.compute(shader(["camera", "areas"]), "add_areas");
    const pass = work.encoder.beginComputePass();
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, this.gpu.bind(pipeline, [this.#camera, this.#buffers[0]!, this.#indices, areas]));
    pass.dispatchWorkgroups(...groupsFor(TOGETHER * groups));
    pass.end();
    work.submit();
    const words = await this.gpu.read(areas);
    areas.destroy();
    return new Float32Array(words.buffer);
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
    code: string,
    entryPoint: string,
    describe: () => {
      layout: GPUBindGroupLayout[];
      targets: GPUColorTargetState[];
      depth?: GPUDepthStencilState;
    },
  ): GPURenderPipeline {
    const key = `${entryPoint}\n${code}`;
    let made = this.#pipelines.get(key);
    if (!made) {
      const { layout, targets, depth } = describe();
      const { device } = this.gpu;
      const module = device.createShaderModule({ code, label: entryPoint });
      made = device.createRenderPipeline({
        label: entryPoint,
        layout: device.createPipelineLayout({ bindGroupLayouts: layout }),
        vertex: { module, entryPoint: "place", buffers: VERTEX_BUFFERS },
        fragment: { module, entryPoint, targets },
        primitive: { topology: "triangle-list", cullMode: "none" },
        ...(depth && { depthStencil: depth }),
      });
      this.#pipelines.set(key, made);
    }
    return made;
  }
}

/** A camera whose target reaches beyond the picture at its right and lower edge; the size stays the picture's. */
export function widened(block: ArrayBuffer, [across, down]: readonly [number, number]): ArrayBuffer {
  const floats = new Float32Array(block.slice(0));
  for (let column = 0; column < 4; ++column) {
    const at = PROJECTION + 4 * column;
    const w = floats[at + 3]!;
    floats[at] = across * floats[at]! + (across - 1) * w;
    floats[at + 1] = down * floats[at + 1]! + (1 - down) * w; // clip space has y upwards, and row 0 is above
  }
  return floats.buffer;
}

/** All indices, cut where `MOST_AT_ONCE` pixels are covered; a group of triangles stays whole. */
export function runsOf(areas: ArrayLike<number>, indices: number): Run[] {
  const runs: Run[] = [];
  let [first, sum] = [0, 0];
  for (let group = 0; group < areas.length; ++group) {
    const begin = 3 * TOGETHER * group;
    if (sum > 0 && sum + areas[group]! > MOST_AT_ONCE) {
      runs.push({ first, end: begin });
      [first, sum] = [begin, 0];
    }
    sum += areas[group]!;
  }
  return [...runs, { first, end: indices }];
}

/** An image with its mipmaps; none is one white texel. */
function upload(gpu: Gpu, pixels: ImageBitmap | null): GPUTexture {
  const { device } = gpu;
  const { width, height } = pixels ?? { width: 1, height: 1 };
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
  if (!pixels) {
    device.queue.writeTexture({ texture }, new Uint8Array([255, 255, 255, 255]), {}, [1, 1]);
    return texture;
  }
  device.queue.copyExternalImageToTexture({ source: pixels }, { texture }, [width, height]);
  const module = device.createShaderModule({ code: shader(["cover", "mipmap"]) });
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
