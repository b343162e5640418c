// One view of a scene: the opaque background, n(p), the tiles' depth ranges, and the buffers that the techniques share.

import { type Bounds, type View, cameraBlock } from "../camera";
import { CONSTANTS } from "../generated";
import type { Gpu } from "../gpu";
import { encodeGamma2 } from "../scene";
import { shader } from "../shaders";
import type { Work } from "../work";
import { BACKGROUND, DEPTH, type Geometry, type Pass } from "./geometry";
import { Store } from "./store";

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

export class Frame extends Store {
  readonly background: GPUTexture;
  readonly depth: GPUTexture;
  /** [P], transparent fragments of every pixel. */
  readonly counts: GPUBuffer;
  /** [T], nearest depth and extent of every tile, between which its pixels' depth bins lie. */
  readonly ranges: GPUBuffer;
  readonly #grid: readonly [columns: number, rows: number];
  readonly #gridBlock: GPUBuffer;
  readonly #targets = new Map<string, GPUTexture>();

  constructor(
    gpu: Gpu,
    readonly geometry: Geometry,
    width: number,
    height: number,
  ) {
    super(gpu, width, height);
    this.background = this.target("background", BACKGROUND);
    this.depth = this.target("depth", DEPTH);
    this.counts = this.words("n", this.pixels);
    this.#grid = [Math.ceil(width / TILE), Math.ceil(height / TILE)];
    this.#gridBlock = gpu.filled(new Uint32Array([...this.#grid, 0, 0]), GPUBufferUsage.UNIFORM);
    this.ranges = this.words("ranges", 2 * this.#grid[0] * this.#grid[1]);
  }

  override get bytes(): number {
    const targets = [...this.#targets.values()];
    return targets.reduce((sum, { format, width, height }) => sum + TEXEL_BYTES[format]! * width * height, super.bytes);
  }

  override destroy(): void {
    super.destroy();
    for (const each of this.#targets.values()) each.destroy();
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
