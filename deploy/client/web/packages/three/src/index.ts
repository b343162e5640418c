// Order-independent transparency for three.js: one pass in the place of `pass(scene, camera)`.

export { DiaphanePassNode, type DiaphaneOptions, diaphanePass } from "./pass";
export type { Technique } from "./techniques";
