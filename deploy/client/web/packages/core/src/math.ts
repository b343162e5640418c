// Vectors and matrices in float64; matrices are arrays of 16, column after column.

export type Vec3 = readonly [number, number, number];
export type Mat4 = readonly number[];

export const add = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a: Vec3, s: number): Vec3 => [s * a[0], s * a[1], s * a[2]];
export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a: Vec3): number => Math.sqrt(dot(a, a));
export const cross = (a: Vec3, b: Vec3): Vec3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** Of unit length; a vector without length becomes z. */
export function unit(a: Vec3): Vec3 {
  const size = length(a);
  return size > 0 ? scaled(a, 1 / size) : [0, 0, 1];
}

/** What the second matrix does, then the first. */
export function product(one: Mat4, two: Mat4): Mat4 {
  return one.map((_, i) => [0, 1, 2, 3].reduce((sum, k) => sum + one[(i % 4) + 4 * k]! * two[i - (i % 4) + k]!, 0));
}

/** A point through an affine matrix. */
export function transformed(m: Mat4, p: Vec3): Vec3 {
  return [
    m[0]! * p[0] + m[4]! * p[1] + m[8]! * p[2] + m[12]!,
    m[1]! * p[0] + m[5]! * p[1] + m[9]! * p[2] + m[13]!,
    m[2]! * p[0] + m[6]! * p[1] + m[10]! * p[2] + m[14]!,
  ];
}

/**
 * The rows of the matrix that normals go with: cofactors, a multiple of the inverse transpose that exists also where a
 * scale is 0. A mirroring matrix keeps outside what was outside.
 */
export function cofactors(m: Mat4): readonly [Vec3, Vec3, Vec3] {
  const x: Vec3 = [m[0]!, m[1]!, m[2]!];
  const y: Vec3 = [m[4]!, m[5]!, m[6]!];
  const z: Vec3 = [m[8]!, m[9]!, m[10]!];
  const sign = dot(x, cross(y, z)) < 0 ? -1 : 1;
  return [scaled(cross(y, z), sign), scaled(cross(z, x), sign), scaled(cross(x, y), sign)];
}
