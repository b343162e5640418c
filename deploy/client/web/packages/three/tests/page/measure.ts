// What ways to draw what is transparent cost, and how far their pictures are from the right one.

import type { Bundle } from "@diaphane/core";
import { oitPass } from "three/addons/tsl/display/OITPassNode.js";
import { pass } from "three/tsl";
import { HalfFloatType, NodeMaterial, type PassNode, QuadMesh, RenderTarget, type WebGPURenderer } from "three/webgpu";
import { diaphanePass } from "../../src/index";
import { held } from "./counters";
import { type Agreement, agreement, deviceOf, read } from "./pictures";
import type { Sample } from "./scenes";

type Way = (sample: Sample) => PassNode;

/** By the names that the page of the benchmark has. */
function ways(bundle: Bundle): Readonly<Record<string, Way>> {
  return {
    "three.js, sorted": ({ scene, camera }) => pass(scene, camera),
    OITPassNode: ({ scene, camera }) => oitPass(scene, camera),
    binned: ({ scene, camera }) => diaphanePass(scene, camera),
    "kbuffer, 2": ({ scene, camera }) => diaphanePass(scene, camera, { budget: 2 }),
    "kbuffer, 8": ({ scene, camera }) => diaphanePass(scene, camera, { budget: 8 }),
    "kbuffer-deep, 0.5": ({ scene, camera }) => diaphanePass(scene, camera, { budget: 0.5, bundle }),
    "kbuffer-deep, 2": ({ scene, camera }) => diaphanePass(scene, camera, { budget: 2, bundle }),
  };
}

/** A way's picture in a target of half floats, which all ways have alike. */
class Shown {
  readonly #target = new RenderTarget(1, 1, { type: HalfFloatType, depthBuffer: false, samples: 0 });
  readonly #material = new NodeMaterial();
  readonly #quad = new QuadMesh(this.#material);
  readonly #pass: PassNode;

  constructor(
    private readonly renderer: WebGPURenderer,
    way: Way,
    sample: Sample,
  ) {
    this.#pass = way(sample);
    this.#material.fragmentNode = this.#pass;
  }

  /** In a frame of its own, since three.js draws a pass once in each; milliseconds that it took. */
  async render(width: number, height: number): Promise<number> {
    this.renderer.setSize(width, height);
    this.#target.setSize(width, height);
    for (let frame = 0; frame < 2; frame++) await new Promise((done) => requestAnimationFrame(done));
    const begun = performance.now();
    this.renderer.setRenderTarget(this.#target);
    this.#quad.render(this.renderer);
    this.renderer.setRenderTarget(null);
    await deviceOf(this.renderer)?.queue.onSubmittedWorkDone();
    return performance.now() - begun;
  }

  read(): Promise<Float64Array> {
    return read(this.renderer, this.#target);
  }

  dispose(): void {
    this.#pass.dispose();
    this.#material.dispose();
    this.#target.dispose();
  }
}

/** Of the target that all ways have. */
const TARGET_BYTES = 8;

interface Account extends Agreement {
  /** Of rendering and computing, without that into the target. */
  readonly passes: number;
  /** Bytes a pixel, the picture and its depth among them. */
  readonly bytes: number;
}

/** What every way, or those that are named, takes for a picture of this size, and how far it is from the right one. */
export async function account(
  renderer: WebGPURenderer,
  sample: Sample,
  bundle: Bundle,
  right: Float64Array,
  width: number,
  height: number,
  names?: readonly string[],
): Promise<Record<string, Account>> {
  const found: Record<string, Account> = {};
  for (const [name, way] of Object.entries(ways(bundle))) {
    if (names && !names.includes(name)) continue;
    const shown = new Shown(renderer, way, sample);
    await shown.render(2 * width, 2 * height);
    const larger = held().bytes;
    await shown.render(width, height);
    const [{ bytes: smaller, passes: before }, pixels] = [held(), width * height];
    await shown.render(width, height);
    const passes = held().passes - before - 1;
    const bytes = (larger - smaller) / (3 * pixels) - TARGET_BYTES;
    found[name] = { ...agreement(right, await shown.read()), passes, bytes };
    shown.dispose();
  }
  return found;
}

/** Milliseconds of frames of every way, in turns, after one that compiles. */
export async function timed(
  renderer: WebGPURenderer,
  sample: Sample,
  bundle: Bundle,
  width: number,
  height: number,
  rounds: number,
): Promise<Record<string, number[]>> {
  const all = Object.entries(ways(bundle)).map(([name, way]) => ({ name, shown: new Shown(renderer, way, sample) }));
  const found: Record<string, number[]> = Object.fromEntries(all.map(({ name }) => [name, []]));
  for (let round = -1; round < rounds; round++)
    for (const { name, shown } of all) {
      const took = await shown.render(width, height);
      if (round >= 0) found[name]!.push(took);
    }
  for (const { shown } of all) shown.dispose();
  return found;
}
