// WGSL modules: a file with the files that it needs before it, and the constants of all as one text.

import { CONSTANTS, TEXELS } from "./generated";
import { DEFAULT_TAIL, type Tail } from "./tail";

const SOURCES: Record<string, string> = import.meta.glob("./shaders/*.wgsl", {
  query: "?raw",
  import: "default",
  eager: true,
});

/** Pixels of a work group of the passes over blocks. */
export const BLOCK = 2048;
/** Where sums of fragments stop; budgets are below. */
export const CEILING = 2 ** 31 - 1;
/** Most fragments of one pixel. */
export const TURNS = 4096;

function constants({ bins, shareLevels, meanLevels }: Tail): string {
  const own = { BINS: `${bins}u`, FOURS: `${bins / 4}u`, SHARE_LEVELS: `${shareLevels}`, MEAN_LEVELS: `${meanLevels}` };
  const shared = { BLOCK: `${BLOCK}u`, TURNS: `${TURNS}u`, TEXELS: `${TEXELS}` };
  return Object.entries({ ...CONSTANTS, ...own, ...shared })
    .map(([name, value]) => `const ${name} = ${value};`)
    .join("\n");
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
