// WGSL modules: a file with the files that it needs before it, and the constants of schemas/tail.py and
// renderer/allocation as one text.

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
/** Rounds in which any price is found. */
export const ROUNDS = 4;
/** Where sums of fragments stop; budgets are below. */
export const CEILING = 2 ** 31 - 1;
/** Fragments of one pixel that can have a slot. */
export const TURNS = 60_000;

/** Words a pixel that the gather pass leaves, and words a pixel of packed depth bins. */
export const gatheredWords = (bins: number): number => 2 + bins;
export const keptWords = (bins: number): number => 1 + bins / 8;

function constants(bins: number): string {
  return `
const BINS = ${bins}u;
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
 * @param bins Depth bins of the tail.
 * @param before Text in front of all, such as a bundle's network.
 */
export function shader(names: readonly string[], bins = 16, before = ""): string {
  const texts = names.map((name) => {
    const text = SOURCES[`./shaders/${name}.wgsl`];
    if (text === undefined) throw new Error(`there is no shader ${name}`);
    return text;
  });
  return [before, constants(bins), ...texts].join("\n");
}
