// `weighted-blended`: a mean weighted by a fixed function of depth (renderer/techniques/weighted_blended.py).

import type { Work } from "../work";
import type { Frame } from "./frame";

/** Renders into `shown`, [P]. */
export async function renderBlended(frame: Frame, work: Work, shown: GPUBuffer): Promise<void> {
  const { sumFormat, scalarFormat } = frame.gpu;
  const targets = [frame.target("tail", sumFormat), frame.target("optical depth", scalarFormat)];
  const pass = { files: ["blended"], entryPoint: "blend_sums", writes: [] };
  await frame.geometry.drawTransparent(work, pass, frame.depth, [], targets);
  resolveMean(frame, work, targets, shown);
}

/** The colour of all fragments as one weighted mean of sums, weighted colour and weight, and optical depth, with their exact total transmittance. */
export function resolveMean(frame: Frame, work: Work, sums: readonly GPUTexture[], shown: GPUBuffer): void {
  const textures = [frame.background, ...sums].map((texture) => texture.createView());
  frame.forPixels(work, ["display", "resolve_blended"], "resolve_blended", [...textures, shown]);
}
