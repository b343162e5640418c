// Tails (schemas/tail.py, METHOD.md section 2): what stands for the fragments that have no slot.

/** Depth bins of each. */
const BINS = {
  "exact-coverage": 0,
  density: 0,
  "weighted-average": 0,
  paper: 0,
  "density-8": 8,
  "density-16": 16,
} as const;

export type TailName = keyof typeof BINS;

export interface Tail {
  readonly name: TailName;
  /** Depth bins; 0: it has none. */
  readonly bins: number;
  /** The constant of `density`. */
  readonly g: number;
}

/** The tail of a name; null: there is none. */
export function tailOf(name: string, g: number): Tail | null {
  return isTail(name) ? { name, bins: BINS[name], g } : null;
}

const isTail = (name: string): name is TailName => Object.hasOwn(BINS, name);

/** Of the techniques that no bundle chooses for. */
export const DEFAULT_TAIL: Tail = { name: "density-16", bins: BINS["density-16"], g: 0 };
