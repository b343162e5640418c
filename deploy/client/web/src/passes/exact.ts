// `sbuffer`, exact: every fragment in contiguous per-pixel runs, sorted, composited (renderer/techniques/sbuffer.py).

import type { Frame } from "./frame";
import type { Pass } from "./geometry";

const CAPTURE: Pass = { files: ["capture"], entryPoint: "capture", writes: [false, true, true], targets: [] };
const FRAGMENT_WORDS = 2;

/**
 * Renders all fragments.
 *
 * @param offsets [P + 1], prefix sums of n.
 * @param fragments N.
 * @param shown [P], gets the picture.
 */
export function renderExact(
  frame: Frame,
  encoder: GPUCommandEncoder,
  offsets: GPUBuffer,
  fragments: number,
  shown: GPUBuffer,
): void {
  const cursors = frame.zeros(encoder, "cursors", frame.pixels);
  const pool = frame.room("pool", FRAGMENT_WORDS * Math.max(fragments, 1)); // a binding holds one at least
  frame.geometry.drawTransparent(encoder, CAPTURE, 16, frame.depth, [offsets, cursors, pool]);
  frame.forPixels(encoder, ["sort"], "sort_runs", [offsets, pool]);
  const read = [offsets, pool, frame.background.createView(), shown];
  frame.forPixels(encoder, ["display", "resolve_exact"], "resolve_exact", read);
}
