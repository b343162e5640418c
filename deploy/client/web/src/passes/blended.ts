// `weighted-blended`: a mean weighted by a fixed function of depth (renderer/techniques/weighted_blended.py).

import type { Frame } from "./frame";

/** Renders into `shown`, [P]. */
export function renderBlended(frame: Frame, encoder: GPUCommandEncoder, shown: GPUBuffer): void {
  const { sumFormat, scalarFormat } = frame.gpu;
  const targets = [frame.target("tail", sumFormat), frame.target("optical depth", scalarFormat)];
  const pass = { files: ["blended"], entryPoint: "blend_sums", writes: [], targets: [sumFormat, scalarFormat] };
  frame.geometry.drawTransparent(encoder, pass, 16, frame.depth, [], targets);
  const read = [frame.background.createView(), ...targets.map((target) => target.createView()), shown];
  frame.forPixels(encoder, ["display", "resolve_blended"], "resolve_blended", read);
}
