// One view of a scene: the opaque background, n(p), the tiles' depth ranges, and the buffers that the techniques share.

import { type Bounds, type View, cameraBlock } from "../camera";
import { CONSTANTS } from "../generated";
import { type Gpu, type Resource, groupsFor } from "../gpu";
import { encodeGamma2 } from "../scene";
import { shader } from "../shaders";
import { DEFAULT_TAIL } from "../tail";
import type { Work } from "../work";
import { BACKGROUND, DEPTH, type Geometry, type Pass } from "./geometry";

/** Side of the tiles, and pixels across one that its range is found from. */
const TILE = Number(CONSTANTS["RANGE_TILE"]);
const STEPS = 2;
const TEXEL_BYTES: Partial<Record<GPUTextureFormat, number>> = {
  [BACKGROUND]: 4,
  [DEPTH]: 4,
  r8unorm: 1,
  r16float: 2,
  r32float: 4,
  rgba16float: 8,
  rgba32float: 16,
};
const RANGE: Pass = { files: ["range"], entryPoint: "find_range", writes: [true] };
const COUNT: Pass = { files: ["count"], entryPoint: "count_fragments", writes: [true] };

export class Frame {
  readonly pixels: number;
  readonly background: GPUTexture;
  readonly depth: GPUTexture;
  /** [P], transparent fragments of every pixel. */
  readonly counts: GPUBuffer;
  /** [T], nearest depth and extent of every tile, between which its pixels' depth bins lie. */
  readonly ranges: GPUBuffer;
  readonly #grid: readonly [columns: number, rows: number];
  readonly #gridBlock: GPUBuffer;
  readonly #buffers = new Map<string, GPUBuffer>();
  readonly #targets = new Map<string, GPUTexture>();

  constructor(
    readonly gpu: Gpu,
    readonly geometry: Geometry,
    readonly width: number,
    readonly height: number,
  ) {
    this.pixels = width * height;
    this.background = this.target("background", BACKGROUND);
    this.depth = this.target("depth", DEPTH);
    this.counts = this.words("n", this.pixels);
    this.#grid = [Math.ceil(width / TILE), Math.ceil(height / TILE)];
    this.#gridBlock = gpu.filled(new Uint32Array([...this.#grid, 0, 0]), GPUBufferUsage.UNIFORM);
    this.ranges = this.words("ranges", 2 * this.#grid[0] * this.#grid[1]);
  }

  /** Bytes of all buffers and textures that there are by now. */
  get bytes(): number {
    const buffers = [...this.#buffers.values()].reduce((sum, { size }) => sum + size, 0);
    const targets = [...this.#targets.values()];
    return targets.reduce((sum, { format, width, height }) => sum + TEXEL_BYTES[format]! * width * height, buffers);
  }

  /** Gives back all buffers and textures. */
  destroy(): void {
    for (const each of [...this.#buffers.values(), ...this.#targets.values()]) each.destroy();
  }

  /** A storage buffer of words that is kept under a name; its content is what was left in it. */
  words(name: string, count: number): GPUBuffer {
    const before = this.#buffers.get(name);
    if (before && before.size === 4 * Math.max(count, 1)) return before;
    before?.destroy();
    this.#buffers.delete(name); // the new one may be more than the device allows
    const made = this.gpu.words(count);
    this.#buffers.set(name, made);
    return made;
  }

  /** The same, perhaps with room for more; its first words are zero when the work is done. */
  zeros(work: Work, name: string, count: number): GPUBuffer {
    const buffer = this.room(name, count);
    work.encoder.clearBuffer(buffer, 0, 4 * count);
    return buffer;
  }

  /** A storage buffer with room for words: it grows, and stays where fewer are needed. */
  room(name: string, count: number): GPUBuffer {
    return this.words(name, Math.max(count, (this.#buffers.get(name)?.size ?? 0) / 4));
  }

  /** A texture, of the frame's size if none is given, that is kept under a name and its format. */
  target(name: string, format: GPUTextureFormat, size = [this.width, this.height]): GPUTexture {
    const key = `${name} ${format}`;
    let texture = this.#targets.get(key);
    if (!texture) {
      const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.TEXTURE_BINDING;
      texture = this.gpu.device.createTexture({ size, format, usage });
      this.#targets.set(key, texture);
    }
    return texture;
  }

  /** Runs a compute shader for every pixel, 64 a group. */
  forPixels(
    work: Work,
    files: readonly string[],
    entryPoint: string,
    resources: readonly Resource[],
    { tail = DEFAULT_TAIL, before = "", threads = this.pixels } = {},
  ): void {
    this.dispatch(work, shader(["pixels", ...files], tail, before), entryPoint, resources, groupsFor(threads));
  }

  /** Runs a compute shader. */
  dispatch(
    work: Work,
    code: string,
    entryPoint: string,
    resources: readonly Resource[],
    groups: readonly [number, number],
  ): void {
    const pipeline = this.gpu.compute(code, entryPoint);
    const pass = work.encoder.beginComputePass();
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, this.gpu.bind(pipeline, resources));
    pass.dispatchWorkgroups(...groups);
    pass.end();
  }

  /**
   * Draws the opaque surfaces, counts the transparent fragments, and finds the tiles' ranges of a view.
   *
   * @param clear Linear grey behind everything.
   * @throws Trouble There is too much to draw.
   */
  async draw(work: Work, view: View, bounds: Bounds, clear: number): Promise<void> {
    const { geometry, width, height } = this;
    const [columns, rows] = this.#grid;
    const block = cameraBlock(view, bounds, geometry.scene.up, width, height);
    await geometry.look(block, [width / (columns * TILE), height / (rows * TILE)], this.pixels);
    const grey = encodeGamma2(clear) / 255;
    await geometry.drawOpaque(work, this.background, this.depth, [grey, grey, grey, 1]);
    work.encoder.clearBuffer(this.counts);
    await geometry.drawTransparent(work, COUNT, this.depth, [this.counts]);
    const found = this.zeros(work, "found ranges", 2 * columns * rows);
    await geometry.drawCoarse(work, RANGE, this.#coarse(), found);
    this.dispatch(work, shader(["fill_ranges"]), "fill_ranges", [found, this.ranges, this.#gridBlock], [1, 1]);
  }

  /** What is drawn into at a fraction of the resolution: a pass needs a target. Whole tiles, also beyond the picture. */
  #coarse(): GPUTexture {
    const size = this.#grid.map((tiles) => tiles * STEPS);
    return this.target("coarse", "r8unorm", size);
  }
}
