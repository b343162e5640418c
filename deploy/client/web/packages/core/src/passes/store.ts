// Buffers of a picture, kept under names, and compute passes over its pixels.

import { type Gpu, type Resource, groupsFor } from "../gpu";
import { shader } from "../shaders";
import { DEFAULT_TAIL } from "../tail";
import type { Work } from "../work";

export class Store {
  readonly pixels: number;
  readonly #buffers = new Map<string, GPUBuffer>();

  constructor(
    readonly gpu: Gpu,
    readonly width: number,
    readonly height: number,
  ) {
    this.pixels = width * height;
  }

  /** Bytes of all that there is by now. */
  get bytes(): number {
    return [...this.#buffers.values()].reduce((sum, { size }) => sum + size, 0);
  }

  /** Gives all of it back. */
  destroy(): void {
    for (const each of this.#buffers.values()) each.destroy();
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
}
