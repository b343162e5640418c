// A bundle's network, as its own WGSL: checked on the rows of its manifest, then run on what was gathered.

import type { Bundle } from "../bundle";
import type { Gpu } from "../gpu";
import { shader } from "../shaders";
import { Trouble } from "../trouble";
import type { Work } from "../work";
import type { Allocation } from "./allocation";
import type { Binned } from "./bins";
import type { Store } from "./store";

const FILES = ["cut_state", "bin_words", "cuts_of_counts", "bins", "kept_bins", "prices"];

/**
 * Predicts the ranks of every occupied pixel's bins, into its words.
 *
 * @param binned What was gathered, with sums of luma.
 * @param ranges [T], nearest depth and extent of every tile.
 * @param background Of every pixel, gamma-2 encoded.
 */
export function predict(
  store: Store,
  work: Work,
  bundle: Bundle,
  binned: Binned,
  into: Allocation,
  ranges: GPUBuffer,
  background: GPUTexture,
): void {
  const read = [binned.words, into.state, ranges, binned.luma!, background.createView()];
  const options = { tail: bundle.tail, before: bundle.wgsl };
  store.forPixels(work, FILES, "predict_ranks", read, options);
}

/**
 * Runs the rows of a bundle's self-test on this device.
 *
 * @throws Trouble The shader does not compile, or answers something else.
 */
export async function selfTest(gpu: Gpu, bundle: Bundle): Promise<void> {
  const { features, outputs, output_scale: scale, tolerance } = bundle.selfTest;
  const { STORAGE, COPY_SRC } = GPUBufferUsage;
  gpu.device.pushErrorScope("validation");
  const pipeline = gpu.compute(shader(["self_test"], bundle.tail, bundle.wgsl), "answer_rows");
  const rows = gpu.filled(new Float32Array(features.flat()), STORAGE);
  const answers = gpu.filled(new Float32Array(outputs.flat().length), STORAGE | COPY_SRC);
  const encoder = gpu.device.createCommandEncoder();
  const pass = encoder.beginComputePass();
  pass.setPipeline(pipeline);
  pass.setBindGroup(0, gpu.bind(pipeline, [rows, answers]));
  pass.dispatchWorkgroups(Math.ceil(features.length / 16));
  pass.end();
  gpu.device.queue.submit([encoder.finish()]);
  const found = new Float32Array((await gpu.read(answers)).buffer);
  const invalid = await gpu.device.popErrorScope();
  const wide = outputs[0]!.length;
  const allowed = tolerance["predict.wgsl"] ?? 0;
  const isRight = outputs.flat().every((value, i) => Math.abs(found[i]! - value) <= allowed * scale[i % wide]!);
  rows.destroy();
  answers.destroy();
  if (invalid || !isRight) {
    throw new Trouble(
      `The network of '${bundle.name}' ${bundle.version} does not answer its self-test rightly on this device.`,
      "Update the browser and the graphics driver; the other techniques work without it.",
    );
  }
}
