// Tails with depth bins (schemas/tail.py, METHOD.md section 2): what stands for the fragments that have no slot.

import { DEFAULT_TAIL as DEFAULT_NAME, TAILS } from "./generated";

export interface Tail {
  readonly name: string;
  /** Depth bins, a multiple of 4. */
  readonly bins: number;
  /** Steps of the share of optical depth in front of a bin. */
  readonly shareLevels: number;
  /** Steps of a bin's mean position; 0: it is not kept. */
  readonly meanLevels: number;
}

/** The tail of a name; null: there is none with depth bins, which a bundle needs. */
export function tailOf(name: string): Tail | null {
  const row = Object.hasOwn(TAILS, name) ? TAILS[name]! : null;
  return row && row.bins > 0 ? { name, ...row } : null;
}

/** Of the techniques that no bundle chooses for. */
export const DEFAULT_TAIL: Tail = tailOf(DEFAULT_NAME)!;

/** The one with the most bins and means: of `binned`, which keeps nothing else. */
export const FINEST_TAIL: Tail = Object.keys(TAILS)
  .flatMap((name) => tailOf(name) ?? [])
  .filter((tail) => tail.meanLevels > 0)
  .reduce((one, two) => (two.bins > one.bins ? two : one));
