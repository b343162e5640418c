// What other packages use: bundles by name, verified; tails and constants; a scene as flat arrays and what renders it.

export type { Bundle, SelfTest } from "./bundle";
export { type Bounds, type View, framingView, moved, turned } from "./camera";
export { CONSTANTS, TAILS } from "./generated";
export { Gpu } from "./gpu";
export { type Mat4, type Vec3, cofactors, cross, length, product, scaled, subtract, transformed, unit } from "./math";
export { Cores, SLOT_WORDS } from "./passes/cores";
export { Geometry } from "./passes/geometry";
export { selfTest } from "./passes/network";
export { type Mode, Screen, meanSquaredError, psnr } from "./passes/screen";
export { type Choice, type Memory, Registry, SignedOut } from "./registry";
export { type Counted, Renderer, TECHNIQUES, type Technique } from "./renderer";
export { type Batch, type Image, type Layer, type Scene, encodeGamma2, orient } from "./scene";
export { shader } from "./shaders";
export { shippedBundle } from "./shipped";
export { DEFAULT_TAIL, FINEST_TAIL, type Tail, tailOf } from "./tail";
export { Trouble } from "./trouble";
export { Abandoned, Work } from "./work";
