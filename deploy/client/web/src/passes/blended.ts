// `weighted-blended`: a mean weighted by a fixed function of depth (renderer/techniques/weighted_blended.py).

import type { Work } from "../work";
import type { Frame } from "./frame";

/** Renders into `shown`, [P]. */
export async function renderBlended(frame: Frame, work: Work, shown: GPUBuffer): Promise<void> {
  const { sumFormat, scalarFormat } = frame.gpu;
  const targets = [frame.target("tail", sumFormat), frame.target("optical depth", scalarFormat)];
  const pass = { files: ["blended"], entryPoint: "blend_sums", writes: [] };
  await frame.geometry.drawTransparent(work, pass, frame.depth, [], targets);
  const read = [frame.background.createView(), ...targets.map((target) => target.createView()), shown];
  frame.forPixels(work, ["display", "resolve_blended"], "resolve_blended", read);
}
