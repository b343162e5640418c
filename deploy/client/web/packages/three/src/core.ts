// The k nearest fragments of every pixel, in slots of storage buffers: an insertion by atomic maxima finds their depths,
// in any order of fragments, and the next pass over the geometry puts each colour where its depth is.

import {
  type Node,
  StorageBufferAttribute,
  type UniformNode,
} from "three/webgpu";
import {
  atomicLoad,
  atomicMax,
  atomicStore,
  Break,
  float,
  floatBitsToUint,
  Fn,
  If,
  Loop,
  packHalf2x16,
  screenCoordinate,
  storage,
  uint,
  uniform,
  unpackHalf2x16,
  vec2,
  vec3,
  vec4,
} from "three/tsl";
import { alpha, colour } from "./surface";
import type { Visible } from "./visible";

/** Most slots of a pixel. */
export const MOST = 8;
/** Bytes of a slot, in three buffers: a depth, two halves of red and green, two of blue and opacity. */
export const SLOT_BYTES = 12;
/** Of what 32 bits of depth may differ between passes. */
const SLACK = 8;

const words = (): StorageBufferAttribute => new StorageBufferAttribute(new Uint32Array(1), 1);

export class Core {
  readonly #k = uniform(1, "uint") as UniformNode<"uint", number>;
  readonly #width = uniform(1, "uint") as UniformNode<"uint", number>;
  readonly #buffers = [words(), words(), words()].map((each) => storage(each, "uint", 1).toAtomic());
  #count = 1;

  /**
   * @param depth Of a fragment.
   * @param visible Whether it is seen.
   */
  constructor(
    private readonly depth: Node<"float">,
    private readonly visible: Visible,
  ) {}

  /** Bytes of the largest buffer for a picture. */
  static bytes(width: number, height: number, k: number): number {
    return 4 * width * height * k;
  }

  /** Makes room, all of it empty. */
  resize(width: number, height: number, k: number): void {
    [this.#width.value, this.#k.value] = [width, k];
    const count = Math.max(width * height * k, 1);
    if (count === this.#count) return;
    this.#count = count;
    for (const each of this.#buffers) {
      each.value.dispose();
      each.value = new StorageBufferAttribute(new Uint32Array(count), 1);
    }
  }

  /** Gives the slots back; what was compiled stays. */
  release(): void {
    this.resize(0, 0, 0);
  }

  /** Inserts a fragment's depth, then says what the pass writes to a target. */
  inserting(output: Node): Node<"vec4"> {
    const [depths] = this.#buffers;
    return Fn(() => {
      const written = vec4(output as Node<"vec4">).toVar();
      const first = this.#first.toVar();
      const carried = this.#key.toVar();
      If(this.visible.is, () => {
        this.#each((i) => {
          const before = atomicMax(depths!.element(first.add(i)), carried).toVar();
          carried.assign(before.lessThan(carried).select(before, carried));
          If(carried.equal(uint(0)), () => void Break());
        });
      });
      return written;
    })();
  }

  /** Puts a fragment's colour into its slot. 1 for one that has none, and is the tail's; else 0. */
  get remaining(): Node<"float"> {
    const [depths, front, back] = this.#buffers;
    return Fn(() => {
      const share = this.visible.share.toVar();
      const shaded = colour.max(0).min(65504).toVar();
      const first = this.#first.toVar();
      const nearer = this.#key.add(uint(SLACK)).toVar();
      const place = uint(0).toVar();
      If(this.visible.is, () => {
        this.#each((i) => {
          If(atomicLoad(depths!.element(first.add(i))).lessThanEqual(nearer), () => void Break());
          place.addAssign(uint(1));
        });
        If(place.lessThan(this.#k), () => {
          share.assign(0);
          const slot = first.add(place);
          // Of fragments of one depth, the maximum is the same in any order.
          atomicMax(front!.element(slot), packHalf2x16(shaded.rg));
          atomicMax(back!.element(slot), packHalf2x16(vec2(shaded.b, alpha)));
        });
      });
      return share;
    })().toVar();
  }

  /** Colour times coverage, and coverage: the core before the tail. It empties the slots for the next frame. */
  over(tail: Node<"vec4">): Node<"vec4"> {
    const [depths, front, back] = this.#buffers;
    return Fn(() => {
      const first = this.#first.toVar();
      const light = vec3(0).toVar();
      const through = float(1).toVar();
      this.#each((i) => {
        const slot = first.add(i);
        const rg = unpackHalf2x16(atomicLoad(front!.element(slot))) as unknown as Node<"vec2">;
        const ba = (unpackHalf2x16(atomicLoad(back!.element(slot))) as unknown as Node<"vec2">).toVar();
        light.addAssign(vec4(rg, ba.x, 0).rgb.mul(through.mul(ba.y)));
        through.mulAssign(ba.y.oneMinus());
        for (const each of [depths!, front!, back!]) atomicStore(each.element(slot), uint(0));
      });
      light.addAssign(tail.rgb.mul(through));
      return vec4(light, through.mul(tail.a.oneMinus()).oneMinus());
    })();
  }

  dispose(): void {
    for (const each of this.#buffers) each.value.dispose();
  }

  /** The nearer, the greater; 0 is an empty slot's. */
  get #key(): Node<"uint"> {
    return uint(0x7f800000).sub(floatBitsToUint(this.depth) as unknown as Node<"uint">);
  }

  get #first(): Node<"uint"> {
    return uint(screenCoordinate.y).mul(this.#width).add(uint(screenCoordinate.x)).mul(this.#k);
  }

  #each(turn: (i: Node<"uint">) => void): void {
    Loop({ start: uint(0), end: this.#k, type: "uint", condition: "<" }, ({ i }) => turn(i as unknown as Node<"uint">));
  }
}
