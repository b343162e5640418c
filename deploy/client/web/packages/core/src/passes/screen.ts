// Pictures on the canvas, and how far they are from each other.

import { type Gpu, entriesOf } from "../gpu";
import { shader } from "../shaders";
import { blocksOf } from "./allocation";
import { Trouble } from "../trouble";
import { Work } from "../work";
import type { Frame } from "./frame";

export const MODES = ["picture", "count", "error"] as const;
/** What is shown: the picture, k of every pixel, or the difference to the exact picture. */
export type Mode = (typeof MODES)[number];

/** Mean squared error of two pictures, over pixels and channels, sRGB bytes in [0,1] (renderer/metrics.py). */
export async function meanSquaredError(frame: Frame, one: GPUBuffer, two: GPUBuffer): Promise<number> {
  const blocks = blocksOf(frame.pixels);
  const squares = frame.words("squares", blocks);
  const work = new Work(frame.gpu);
  frame.dispatch(work, shader(["difference"]), "add_squares", [one, two, squares], [blocks, 1]);
  work.submit();
  const sums = await frame.gpu.read(squares);
  return sums.reduce((sum, each) => sum + each, 0) / (3 * frame.pixels * 255 ** 2);
}

/** Peak signal-to-noise ratio, dB; infinite for no error. */
export const psnr = (error: number): number => (error === 0 ? Infinity : -10 * Math.log10(error));

export class Screen {
  readonly #context: GPUCanvasContext;
  readonly #pipeline: GPURenderPipeline;
  readonly #wanted: GPUBuffer;

  /**
   * @param canvas Where they are shown.
   * @throws Trouble It cannot show any.
   */
  constructor(
    readonly gpu: Gpu,
    canvas: HTMLCanvasElement,
  ) {
    const format = navigator.gpu.getPreferredCanvasFormat();
    const context = canvas.getContext("webgpu");
    if (!context) throw new Trouble("The browser cannot show what WebGPU draws.", "Update the browser.");
    this.#context = context;
    this.#context.configure({ device: gpu.device, format, alphaMode: "opaque" });
    const module = gpu.device.createShaderModule({ code: shader(["cover", "present"]) });
    this.#pipeline = gpu.device.createRenderPipeline({
      layout: "auto",
      vertex: { module, entryPoint: "cover" },
      fragment: { module, entryPoint: "present", targets: [{ format }] },
    });
    this.#wanted = gpu.filled(new Uint32Array(4), GPUBufferUsage.UNIFORM);
  }

  /** Shows what is behind every picture. */
  clear(): void {
    const encoder = this.gpu.device.createCommandEncoder();
    this.#begin(encoder).end();
    this.gpu.device.queue.submit([encoder.finish()]);
  }

  /** Shows two pictures, [P] each, beside each other; `split` is the column where the right one begins. */
  show(frame: Frame, mode: Mode, split: number, left: GPUBuffer, right: GPUBuffer, exact: GPUBuffer): void {
    const { device } = this.gpu;
    const block = new ArrayBuffer(16);
    new Float32Array(block)[0] = split;
    new Uint32Array(block).set([MODES.indexOf(mode), frame.width], 1);
    device.queue.writeBuffer(this.#wanted, 0, block);
    const encoder = device.createCommandEncoder();
    const pass = this.#begin(encoder);
    pass.setPipeline(this.#pipeline);
    const layout = this.#pipeline.getBindGroupLayout(0);
    const entries = entriesOf([this.#wanted, left, right, exact]);
    pass.setBindGroup(0, device.createBindGroup({ layout, entries }));
    pass.draw(3);
    pass.end();
    device.queue.submit([encoder.finish()]);
  }

  #begin(encoder: GPUCommandEncoder): GPURenderPassEncoder {
    const view = this.#context.getCurrentTexture().createView();
    return encoder.beginRenderPass({
      colorAttachments: [{ view, loadOp: "clear", storeOp: "store", clearValue: [1, 1, 1, 1] }],
    });
  }
}
