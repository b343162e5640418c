// What tests call: `three.compare(...)` and its like.

import { DataUtils, RenderPipeline, WebGPURenderer } from "three/webgpu";
import { type Bundle, tailOf } from "@diaphane/core";
import { type DiaphaneOptions, diaphanePass } from "../../src/index";
import { peel, type Reference } from "./reference";
import { SCENES, type Sample } from "./scenes";

const [WIDTH, HEIGHT] = [256, 192];

const encode = (linear: number): number => {
  const x = Math.min(Math.max(linear, 0), 1);
  return 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
};

async function start(forceWebGL: boolean): Promise<WebGPURenderer> {
  const renderer = new WebGPURenderer({ forceWebGL, antialias: false });
  renderer.setPixelRatio(1);
  renderer.setSize(WIDTH, HEIGHT);
  document.body.append(renderer.domElement);
  await renderer.init();
  return renderer;
}

interface Agreement {
  /** Share of pixels within 2 of 255, and root of the mean squared difference, in 255ths. */
  readonly within: number;
  readonly rmse: number;
  readonly most: number;
}

/** A bundle of which only its network is known. */
function bundleOf(tail: string, wgsl: string): Bundle {
  const selfTest = { features: [], outputs: [], output_scale: [], tolerance: {} };
  return { name: "tested", version: "1.0.0", tail: tailOf(tail)!, wgsl, selfTest, isSigned: true };
}

async function linear(renderer: WebGPURenderer, sample: Sample, options: DiaphaneOptions): Promise<Float64Array> {
  return (await drawnBy(renderer, sample, options)).picture;
}

/** The picture, rows from the top, and what `kbuffer-deep` gave its pixels. */
async function drawnBy(renderer: WebGPURenderer, sample: Sample, options: DiaphaneOptions) {
  const pass = diaphanePass(sample.scene, sample.camera, options);
  const pipeline = new RenderPipeline(renderer, pass);
  pipeline.render();
  const halves = await renderer.readRenderTargetPixelsAsync(pass.renderTarget, 0, 0, WIDTH, HEIGHT);
  const made = new Float64Array(3 * WIDTH * HEIGHT);
  for (let i = 0; i < made.length; i++) made[i] = DataUtils.fromHalfFloat(halves[Math.floor(i / 3) * 4 + (i % 3)]!);
  const slots = await pass.slots();
  pass.dispose();
  pipeline.dispose();
  return { picture: made, budget: slots?.budget ?? 0, used: slots?.k.reduce((sum, k) => sum + k, 0) ?? 0 };
}

/** What the renderer holds after a pass was used, resized and given another budget, and disposed of; before, too. */
async function life(renderer: WebGPURenderer): Promise<readonly (readonly number[])[]> {
  const sample = SCENES["panes"]!();
  const held = (): number[] => {
    const { textures, renderTargets, storageAttributes } = renderer.info.memory as unknown as Record<string, number>;
    return [textures!, renderTargets!, storageAttributes!];
  };
  await linear(renderer, sample, {});
  const before = held();
  const pass = diaphanePass(sample.scene, sample.camera, { budget: 2 });
  const pipeline = new RenderPipeline(renderer, pass);
  pipeline.render();
  const during = held();
  renderer.setSize(120, 90);
  pass.budget = 5;
  pipeline.render();
  pass.budget = 0;
  pipeline.render();
  renderer.setSize(WIDTH, HEIGHT);
  pass.budget = 2;
  pipeline.render();
  const again = held();
  pass.dispose();
  pipeline.dispose();
  return [before, during, again, held()];
}

/** A scene whose objects are drawn the other way round. */
function reversed(sample: Sample): Sample {
  const ours = sample.scene.children.slice().reverse();
  ours.forEach((each, i) => (each.renderOrder = i));
  return sample;
}

function agreement(one: Float64Array, two: Float64Array): Agreement {
  let [within, squares, most] = [0, 0, 0];
  for (let p = 0; p < one.length; p += 3) {
    let apart = 0;
    for (let c = 0; c < 3; c++) {
      const difference = Math.abs(encode(one[p + c]!) - encode(two[p + c]!));
      squares += difference ** 2;
      apart = Math.max(apart, difference);
    }
    most = Math.max(most, apart);
    if (apart <= 2) within++;
  }
  return { within: within / (one.length / 3), rmse: Math.sqrt(squares / one.length), most };
}

function drawn(picture: Float64Array, title: string): void {
  const canvas = Object.assign(document.createElement("canvas"), { width: WIDTH, height: HEIGHT, title });
  const pixels = new Uint8ClampedArray(4 * WIDTH * HEIGHT).fill(255);
  for (let i = 0; i < picture.length; i++) pixels[Math.floor(i / 3) * 4 + (i % 3)] = encode(picture[i]!);
  canvas.getContext("2d")!.putImageData(new ImageData(pixels, WIDTH, HEIGHT), 0, 0);
  document.body.append(canvas);
}

const three = { start, SCENES, life, reversed, linear, drawnBy, bundleOf, peel: (r: WebGPURenderer, s: Sample): Promise<Reference> => peel(r, s, WIDTH, HEIGHT), agreement, drawn };
Object.assign(globalThis, { three });
export type Three = typeof three;
