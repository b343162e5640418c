// A scene as flat arrays, ready for upload: world space, metres, relative to the centre of its bounds
// (schemas/scene.py: SceneArrays).

import { type Vec3, cross, dot, subtract } from "./math";

export type Layer = "opaque" | "mixed" | "transparent";

export interface Image {
  readonly pixels: ImageBitmap;
  readonly wrap: readonly [GPUAddressMode, GPUAddressMode];
}

/** A run of triangles of one look; constant colours are in the vertices. */
export interface Batch {
  readonly first: number;
  readonly count: number;
  readonly layer: Layer;
  readonly image: Image | null;
  /** Factor of the image's linear colour and opacity. */
  readonly scale: readonly [number, number, number, number];
  /** Opacity below which nothing is there, and from which on it is opaque; 0: it is blended. */
  readonly threshold: number;
}

export interface Scene {
  readonly name: string;
  readonly positions: Float32Array<ArrayBuffer>;
  readonly normals: Float32Array<ArrayBuffer>;
  readonly uvs: Float32Array<ArrayBuffer>;
  /** RGB gamma-2 encoded linear colour, alpha linear; four bytes a vertex. */
  readonly colours: Uint8Array<ArrayBuffer>;
  readonly indices: Uint32Array<ArrayBuffer>;
  readonly batches: readonly Batch[];
  readonly bounds: readonly [Vec3, Vec3];
  readonly up: Vec3;
}

/** A linear value in [0,1] as it is stored: the square root in 8 bits (schemas/colour.py). */
export function encodeGamma2(linear: number): number {
  return Math.floor(Math.sqrt(Math.min(Math.max(linear, 0), 1)) * 255 + 0.5);
}

/**
 * Winds every triangle as its normals say, so that `front_facing` tells on which side of a surface the eye is, also
 * where a file winds its faces the other way.
 */
export function orient(positions: Float32Array, normals: Float32Array, indices: Uint32Array): void {
  const at = (values: Float32Array, i: number): Vec3 => [values[3 * i]!, values[3 * i + 1]!, values[3 * i + 2]!];
  for (let t = 0; t < indices.length; t += 3) {
    const [i, j, k] = [indices[t]!, indices[t + 1]!, indices[t + 2]!];
    const a = at(positions, i);
    const face = cross(subtract(at(positions, j), a), subtract(at(positions, k), a));
    if (dot(face, at(normals, i)) + dot(face, at(normals, j)) + dot(face, at(normals, k)) < 0) {
      indices[t + 1] = k;
      indices[t + 2] = j;
    }
  }
}
