// Cores of pixels, as a bundle's network shares a budget out: fragments are gathered into depth bins, the network says
// what each bin is worth, whole bins are granted at one price, and those are captured, sorted and composited exactly.

import { type Bundle, Cores, type Gpu, SLOT_WORDS, type Tail as Bins, shader } from "@diaphane/core";
import {
  type MRTNode,
  type Node,
  type RenderTarget,
  StorageBufferAttribute,
  UnsignedByteType,
  type UniformNode,
  type WebGPURenderer,
} from "three/webgpu";
import {
  code,
  float,
  Fn,
  If,
  int,
  screenCoordinate,
  screenUV,
  storage,
  texture,
  uint,
  uniform,
  uvec3,
  vec2,
  vec4,
  wgslFn,
} from "three/tsl";
import type { Range } from "./range";
import { alpha, colour, opticalDepth } from "./surface";
import type { Tail } from "./tail";
import { Filter, type Draw, over, summed, targetOf } from "./targets";
import { forget } from "./upkeep";
import type { Visible } from "./visible";

const NAMES = ["words", "luma", "offsets", "cuts", "cursors", "pool"] as const;
type Name = (typeof NAMES)[number];
type Words = ReturnType<typeof storage<"uint">>;

const GATHER = `fn diaphane_gather(p: u32, z: f32, range: vec2f, own: f32, rgb: vec3u) -> f32 {
    let place = bin_place(z, range);
    let bin = bin_of(place);
    let units = units_in(own);
    add_to_bin(BINS * p + bin, units, u32(f32(units) * (place - f32(bin)) + 0.5));
    add_luma(p, units, rgb);
    return 0.0;
}`;
/** 1: the fragment is the tail's; 0: it has a slot. */
const CAPTURE = `fn diaphane_capture(p: u32, z: f32, range: vec2f, rgb: vec3f, a: f32) -> f32 {
    if (bin_of(bin_place(z, range)) < cuts[p]) {
        let at = offsets[p] + atomicAdd(&cursors[p], 1u);
        if (at < offsets[p + 1u]) {
            atomicStore(&pool[${SLOT_WORDS}u * at], bitcast<u32>(z));
            atomicStore(&pool[${SLOT_WORDS}u * at + 1u], pack2x16float(rgb.rg));
            atomicStore(&pool[${SLOT_WORDS}u * at + 2u], pack2x16float(vec2f(rgb.b, a)));
            return 0.0;
        }
    }
    return 1.0;
}`;
const WEIGHT = `fn diaphane_weight(p: u32, z: f32, range: vec2f, own: f32, a: f32) -> f32 {
    return a * exp(-min(in_front(p, bin_place(z, range), own), MAX_EXPONENT));
}`;
/** Light of a pixel's core, and what it lets through. */
const RESOLVE = `fn diaphane_resolve(p: u32) -> vec4f {
    var light = vec4f(0.0, 0.0, 0.0, 1.0);
    let k = min(cursors[p], offsets[p + 1u] - offsets[p]);
    for (var i = offsets[p]; i < offsets[p] + k; i++) {
        let rg = unpack2x16float(pool[${SLOT_WORDS}u * i + 1u]);
        let ba = unpack2x16float(pool[${SLOT_WORDS}u * i + 2u]);
        light = vec4f(light.rgb + light.a * ba.y * vec3f(rg, ba.x), light.a * (1.0 - ba.y));
    }
    return light;
}`;

/** What three.js calls a buffer in the place of the core's name. */
const named = (text: string): string => text.replace(/\b(words|luma|offsets|cuts|cursors|pool)\[/g, "diaphane_$1.value[");

export class Deep {
  readonly #width = uniform(1, "uint") as UniformNode<"uint", number>;
  readonly #nodes: { readonly name: Name; readonly node: Words }[] = [];
  readonly #held = new Map<Name, { readonly buffer: GPUBuffer; readonly attribute: StorageBufferAttribute }>();
  readonly #background = targetOf([{ name: "background", type: UnsignedByteType }]);
  readonly #encode: Filter;
  readonly #gathered: MRTNode;
  readonly #captured: MRTNode;
  readonly #over: Filter;
  #cores: Cores | null = null;
  #slots = 0;

  /**
   * @param bins The tail of the bundles that it is for.
   * @param depth Of a fragment.
   * @param picture Has the opaque objects.
   */
  constructor(
    private readonly renderer: WebGPURenderer,
    private readonly gpu: Gpu,
    readonly bins: Bins,
    depth: Node<"float">,
    private readonly range: Range,
    private readonly tail: Tail,
    private readonly visible: Visible,
    private readonly picture: RenderTarget,
  ) {
    const behind = texture(picture.texture, screenUV).level(int(0)).rgb;
    this.#encode = new Filter(vec4(behind.clamp(0, 1).sqrt(), 1));
    this.#gathered = this.#gathering(depth);
    this.#captured = this.#capturing(depth);
    this.#over = this.#resolving();
  }

  /** Bytes of the largest buffer for a picture. */
  static bytes(pixels: number, budget: number, { bins }: Bins): number {
    return 4 * Math.max(bins * pixels, SLOT_WORDS * Math.floor(budget * pixels));
  }

  /** Bytes of what there is beside targets of the other techniques. */
  get bytes(): number {
    return this.#cores?.bytes ?? 0;
  }

  /** F, of the last picture. */
  get slots(): number {
    return this.#slots;
  }

  /** [P + 1] of the last picture: where each pixel's run of slots begins. */
  async offsets(): Promise<Uint32Array> {
    return this.#cores ? this.gpu.read(this.#cores.offsets) : new Uint32Array(1);
  }

  /**
   * Renders what is transparent; the ranges of tiles are known.
   *
   * @param budget Slots of a pixel, on average.
   */
  render(bundle: Bundle, budget: number, draw: Draw): void {
    const cores = this.#sized();
    this.#slots = cores.slots(budget);
    this.#bind(cores);
    cores.begin();
    draw(this.tail.target, this.#gathered);
    this.#encode.render(this.renderer, this.#background);
    const [tiles, background] = [this.range.tiles, this.#background].map((each) => this.#raw(each));
    cores.select(bundle, this.#slots, tiles!, background!);
    draw(this.tail.target, this.#captured);
    cores.sort(this.#slots);
    this.#over.render(this.renderer, this.picture);
  }

  /** Gives its buffers back; what was compiled stays. */
  release(): void {
    for (const { attribute } of this.#held.values()) attribute.dispose();
    this.#held.clear();
    this.#cores?.destroy();
    this.#cores = null;
    this.#background.dispose();
  }

  dispose(): void {
    this.release();
    forget(this.renderer, new Set([this.#gathered, this.#captured]));
    this.#encode.dispose();
    this.#over.dispose();
  }

  #sized(): Cores {
    const { width, height } = this.picture;
    if (this.#cores?.width !== width || this.#cores.height !== height) this.release();
    this.#background.setSize(width, height);
    this.#width.value = width;
    return (this.#cores ??= new Cores(this.gpu, width, height, this.bins));
  }

  /** Lends the core's buffers to three.js. */
  #bind(cores: Cores): void {
    for (const name of NAMES) {
      const buffer = name === "pool" ? cores.pool(this.#slots) : cores[name];
      const before = this.#held.get(name);
      if (before?.buffer === buffer) continue;
      before?.attribute.dispose();
      const attribute = new StorageBufferAttribute(new Uint32Array(1), 1);
      dataOf(this.renderer, attribute).buffer = buffer; // it makes none where there is one
      this.#held.set(name, { buffer, attribute });
      for (const each of this.#nodes) if (each.name === name) each.node.value = attribute;
    }
  }

  #raw(target: RenderTarget): GPUTexture {
    return dataOf(this.renderer, target.texture).texture!;
  }

  #gathering(depth: Node<"float">): MRTNode {
    const files = this.#code(["bins", "bin_words", "add_to_bins"], { words: true, luma: true });
    const gather = wgslFn(GATHER, [files]);
    const gathered = Fn(() => {
      const nothing = float(0).toVar();
      const range = this.#extent.toVar();
      const rgb = uvec3(colour.clamp(0, 1).sqrt().mul(255).add(0.5)).toVar();
      const [z, own] = [depth.toVar(), opticalDepth.toVar()];
      If(this.visible.is, () => void nothing.assign(gather(this.#pixel, z, range, own, rgb) as Node<"float">));
      return vec4(nothing);
    })();
    return summed({ mean: gathered, depth: vec4(0) });
  }

  #capturing(depth: Node<"float">): MRTNode {
    const files = this.#code(["bins", "bin_words", "kept_bins", "in_front"], { words: false });
    const kept = this.#code([], { offsets: false, cuts: false, cursors: true, pool: true });
    const [capture, weigh] = [wgslFn(named(CAPTURE), [files, kept]), wgslFn(WEIGHT, [files])];
    const range = this.#extent.toVar();
    const share = Fn(() => {
      const left = this.visible.share.toVar();
      const shaded = colour.max(0).min(65504).toVar();
      const z = depth.toVar();
      If(this.visible.is, () => void left.assign(capture(this.#pixel, z, range, shaded, alpha) as Node<"float">));
      return left;
    })().toVar();
    const weight = weigh(this.#pixel, depth, range, opticalDepth, alpha) as Node<"float">;
    return this.tail.mrt(weight, share);
  }

  #resolving(): Filter {
    const kept = this.#code([], { offsets: false, cursors: false, pool: false });
    const resolve = wgslFn(named(RESOLVE), [kept]);
    const core = (resolve(this.#pixel) as Node<"vec4">).toVar();
    const tail = this.tail.picture.toVar();
    return over(vec4(core.rgb.add(tail.rgb.mul(core.a)), core.a.mul(tail.a.oneMinus()).oneMinus()));
  }

  /** Files of the core, and the buffers that they name: true, those that are written. */
  #code(files: readonly string[], buffers: Partial<Record<Name, boolean>>): Node {
    const nodes = Object.entries(buffers).map(([name, isWritten]) => {
      const made = storage(new StorageBufferAttribute(new Uint32Array(1), 1), "uint", 1).setName(`diaphane_${name}`);
      const node = (isWritten ? made.toAtomic() : made.toReadOnly()) as Words;
      this.#nodes.push({ name: name as Name, node });
      return node;
    });
    return code(files.length ? named(shader(files, this.bins)) : "", nodes);
  }

  /** Nearest depth and extent of the fragment's tile. */
  get #extent(): Node<"vec2"> {
    const { here } = this.range;
    return vec2(here.x, here.y.sub(here.x).max(0));
  }

  get #pixel(): Node<"uint"> {
    return uint(screenCoordinate.y).mul(this.#width).add(uint(screenCoordinate.x));
  }
}

/** What the backend has of a texture or an attribute. */
function dataOf(renderer: WebGPURenderer, of: object): { buffer?: GPUBuffer; texture?: GPUTexture } {
  return (renderer.backend as unknown as { get(of: object): { buffer?: GPUBuffer; texture?: GPUTexture } }).get(of);
}
