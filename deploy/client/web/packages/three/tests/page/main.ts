// What tests call: `three.compare(...)` and its like.

import { RenderPipeline, WebGPURenderer } from "three/webgpu";
import { type Bundle, tailOf } from "@diaphane/core";
import { type DiaphaneOptions, diaphanePass } from "../../src/index";
import { count, type Held, held } from "./counters";
import { account, timed } from "./measure";
import { type Agreement, agreement, deviceOf, encode, read } from "./pictures";
import { peel, type Reference } from "./reference";
import { SCENES, type Sample } from "./scenes";

const [WIDTH, HEIGHT] = [256, 192];

count();

async function start(forceWebGL: boolean, more: ConstructorParameters<typeof WebGPURenderer>[0] = {}): Promise<WebGPURenderer> {
  const renderer = new WebGPURenderer({ forceWebGL, antialias: false, ...more });
  renderer.setPixelRatio(1);
  renderer.setSize(WIDTH, HEIGHT);
  document.body.append(renderer.domElement);
  await renderer.init();
  return renderer;
}

/** A bundle of which only its network is known. */
function bundleOf(tail: string, wgsl: string): Bundle {
  const selfTest = { features: [], outputs: [], output_scale: [], tolerance: {} };
  return { name: "tested", version: "1.0.0", tail: tailOf(tail)!, wgsl, selfTest, isSigned: true };
}

async function linear(renderer: WebGPURenderer, sample: Sample, options: DiaphaneOptions): Promise<Float64Array> {
  return (await drawnBy(renderer, sample, options)).picture;
}

/** The picture, and what `kbuffer-deep` gave its pixels. */
async function drawnBy(renderer: WebGPURenderer, sample: Sample, options: DiaphaneOptions) {
  const pass = diaphanePass(sample.scene, sample.camera, options);
  const pipeline = new RenderPipeline(renderer, pass);
  pipeline.render();
  const picture = await read(renderer, pass.renderTarget);
  const slots = await pass.slots();
  pass.dispose();
  pipeline.dispose();
  return { picture, budget: slots?.budget ?? 0, used: slots?.k.reduce((sum, k) => sum + k, 0) ?? 0 };
}

/** Pictures in turns, with each of some options, by one pass; what the device holds after each, and after `dispose`. */
async function life(renderer: WebGPURenderer, sample: Sample, turns: readonly DiaphaneOptions[]): Promise<Held[]> {
  const found = [held()];
  const pass = diaphanePass(sample.scene, sample.camera);
  const pipeline = new RenderPipeline(renderer, pass);
  for (const { budget = 0, technique = "kbuffer", bundle = null } of turns) {
    Object.assign(pass, { budget, technique, bundle });
    pipeline.render();
    await deviceOf(renderer).queue.onSubmittedWorkDone();
    found.push(held());
  }
  pass.dispose();
  pipeline.dispose();
  return [...found, held()];
}

/** How far pictures of one pass are apart, of which the second is drawn after the device was lost. */
async function lost(renderer: WebGPURenderer, sample: Sample, options: DiaphaneOptions): Promise<Agreement> {
  const pass = diaphanePass(sample.scene, sample.camera, options);
  const pictures: Float64Array[] = [];
  let current = renderer;
  for (const isLast of [false, true]) {
    const pipeline = new RenderPipeline(current, pass);
    pipeline.render();
    pictures.push(await read(current, pass.renderTarget));
    if (isLast) break;
    const device = deviceOf(current);
    device.destroy();
    await device.lost;
    current = await start(false);
  }
  pass.dispose();
  return agreement(pictures[0]!, pictures[1]!);
}

/** A scene whose objects are drawn the other way round. */
function reversed(sample: Sample): Sample {
  const ours = sample.scene.children.slice().reverse();
  ours.forEach((each, i) => (each.renderOrder = i));
  return sample;
}

function drawn(picture: Float64Array, title: string): void {
  const canvas = Object.assign(document.createElement("canvas"), { width: WIDTH, height: HEIGHT, title });
  const pixels = new Uint8ClampedArray(4 * WIDTH * HEIGHT).fill(255);
  for (let i = 0; i < picture.length; i++) pixels[Math.floor(i / 3) * 4 + (i % 3)] = encode(picture[i]!);
  canvas.getContext("2d")!.putImageData(new ImageData(pixels, WIDTH, HEIGHT), 0, 0);
  document.body.append(canvas);
}

const three = { start, account, timed, SCENES, life, lost, held, reversed, linear, drawnBy, bundleOf, peel: (r: WebGPURenderer, s: Sample): Promise<Reference> => peel(r, s, WIDTH, HEIGHT), agreement, drawn };
Object.assign(globalThis, { three });
export type Three = typeof three;
