// `binned`: a binned tail and nothing else, an atomic and an additive pass (renderer/techniques/binned.py).

import type { Work } from "../work";
import { type Binned, TAIL_FILES, tailBuffers, tailTargets } from "./bins";
import { resolveMean } from "./blended";
import type { Frame } from "./frame";

const BLEND = { files: [...TAIL_FILES, "binned"], entryPoint: "blend_tail", writes: [false, false] };

/** Renders into `shown`, [P]. */
export async function renderBinned(frame: Frame, work: Work, binned: Binned, shown: GPUBuffer): Promise<void> {
  const targets = tailTargets(frame);
  const pass = { ...BLEND, tail: binned.tail };
  await frame.geometry.drawTransparent(work, pass, frame.depth, tailBuffers(frame, binned), targets);
  resolveMean(frame, work, targets, shown);
}
