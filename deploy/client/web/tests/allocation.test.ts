import { expect, it } from "vitest";

import { blocksOf, budgetOf } from "../src/passes/allocation";
import { BLOCK, CEILING, EDGES, LAST, ROUNDS, gatheredWords, keptWords, shader } from "../src/shaders";

it("blocks hold every pixel and the offset behind the last one", () => {
  for (const pixels of [1, BLOCK - 1, BLOCK, BLOCK + 1, 480 * 320]) {
    expect(blocksOf(pixels) * BLOCK).toBeGreaterThanOrEqual(pixels + 1);
    expect((blocksOf(pixels) - 1) * BLOCK).toBeLessThan(pixels + 1);
  }
});

it("a budget is whole slots below where sums stop", () => {
  expect(budgetOf(0.25, 10)).toBe(2);
  expect(budgetOf(1e9, 1e6)).toBe(CEILING - 1);
});

it("any price is found in the rounds that are run", () => {
  // choose.wgsl: the budget lies between two edges, which are the next round's ends.
  const edge = (low: number, high: number, j: number) =>
    Math.min(low + Math.trunc((high - low + EDGES) / (EDGES + 1)) * (j + 1), high);
  for (const wanted of [-LAST, -LAST + 1, -1, 0, 1, 12345, LAST - 2, LAST - 1]) {
    let [low, high] = [-LAST, LAST];
    for (let round = 0; round < ROUNDS; ++round) {
      const edges = Array.from({ length: EDGES }, (_, j) => edge(low, high, j));
      const beyond = edges.find((each) => each > wanted);
      low = edges.filter((each) => each <= wanted).at(-1) ?? low;
      high = beyond ?? high;
    }
    expect([low, high]).toEqual([wanted, wanted + 1]);
  }
});

it("words a pixel are those of the shaders", () => {
  expect([gatheredWords(16), keptWords(16), keptWords(8)]).toEqual([18, 3, 2]);
  expect(shader(["depth_bins"], 8)).toContain("const BINS = 8u;");
  expect(() => shader(["nothing"])).toThrow();
});
