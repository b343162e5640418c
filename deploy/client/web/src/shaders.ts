// WGSL modules: a file with the files that it needs before it, and the constants of schemas/tail.py and
// renderer/allocation as one text.

import { DEFAULT_TAIL, type Tail, type TailName } from "./tail";

const SOURCES: Record<string, string> = import.meta.glob("./shaders/*.wgsl", {
  query: "?raw",
  import: "default",
  eager: true,
});

/** Pixels of a work group of the passes over blocks. */
export const BLOCK = 2048;
/** Prices that one round of the allocation counts at. */
export const EDGES = 64;
/** Index of the greatest price. */
export const LAST = 115 << 14;
/** Rounds in which any price is found, the one around the last frame's with them. */
export const ROUNDS = 5;
/** Where sums of fragments stop; budgets are below. */
export const CEILING = 2 ** 31 - 1;
/** Most fragments of one pixel. */
export const TURNS = 4096;

/** Words a pixel of the gather pass: depth bins are half words. */
export const gatheredWords = (bins: number): number => 2 + bins / 2;

/** Beyond it nothing changes: exponents stop at MAX_EXPONENT. */
const MOST_G = 1e30;

const CODES: Readonly<Record<TailName, string>> = {
  "exact-coverage": "EXACT_COVERAGE",
  density: "DENSITY",
  "weighted-average": "WEIGHTED_AVERAGE",
  paper: "PAPER",
  "density-8": "BINNED",
  "density-16": "BINNED",
};

function constants({ name, bins, g }: Tail): string {
  const codes = [...new Set(Object.values(CODES))].map((code, i) => `const ${code} = ${i}u;`);
  return `
${codes.join("\n")}
const TAIL = ${CODES[name]};
const DENSITY_G = f32(${Math.min(g, MOST_G)});
const BINS = ${bins}u;
const LAST_BIN = ${Math.max(bins, 1) - 1}u;
const EVERY = ${bins && 16 / bins}u;
const GATHERED = ${gatheredWords(bins)}u;
const ROOT_SHARE = 0.6f;
const PLAIN_SHARE = 0.4f;
const SHARE_LEVELS = 15u;
const OPTICAL_UNIT = 951.0f;
const OPTICAL_ONE = 1048576.0f;
const OPTICAL_CEILING = 0x80000000u;
const BIN_LIMIT = 65535u;
const MAX_EXPONENT = 60.0f;
const BLOCK = ${BLOCK}u;
const EDGES = ${EDGES};
const LAST = ${LAST};
const SHIFT = 9u;
const TURNS = ${TURNS}u;
const MOST_GAIN = 0x1p100f;
const LEAST_RATE = 0x1p-98f;
const MOST_RATE = 4096.0f;
`;
}

/**
 * The text of a module.
 *
 * @param names Files of `shaders/`, without suffix, in order.
 * @param tail Which the module is for.
 * @param before Text in front of all, such as a bundle's network.
 */
export function shader(names: readonly string[], tail = DEFAULT_TAIL, before = ""): string {
  const texts = names.map((name) => {
    const text = SOURCES[`./shaders/${name}.wgsl`];
    if (text === undefined) throw new Error(`there is no shader ${name}`);
    return text;
  });
  return [before, constants(tail), ...texts].join("\n");
}
