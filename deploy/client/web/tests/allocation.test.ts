import { expect, it } from "vitest";

import { blocksOf, budgetOf } from "../src/passes/allocation";
import { runsOf } from "../src/passes/geometry";
import { BLOCK, CEILING, EDGES, LAST, ROUNDS, gatheredWords, shader } from "../src/shaders";
import { tailOf } from "../src/tail";

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
  // begin.wgsl: around the last frame's answer, if there is one.
  const first = (low: number, high: number, before: number | null) => (j: number) => {
    if (before === null) return edge(low, high, j);
    const from = Math.trunc(before / EDGES) * EDGES - (EDGES * EDGES) / 2;
    return Math.min(Math.max(from + EDGES * j, -LAST), LAST);
  };
  const roundsFor = (wanted: number, before: number | null): number => {
    let [low, high] = [-LAST, LAST];
    let place = first(low, high, before);
    let rounds = 0;
    for (; high - low > 1; ++rounds) {
      const edges = Array.from({ length: EDGES }, (_, j) => place(j));
      const beyond = edges.find((each) => each > wanted);
      low = edges.filter((each) => each <= wanted).at(-1) ?? low;
      high = beyond ?? high;
      place = (j) => edge(low, high, j);
    }
    expect([low - wanted, high - wanted]).toEqual([0, 1]);
    return rounds;
  };
  const some = [-LAST, -LAST + 1, -1, 0, 1, 12345, LAST - 2, LAST - 1];
  for (const wanted of some) {
    for (const before of [null, ...some]) expect(roundsFor(wanted, before)).toBeLessThanOrEqual(ROUNDS);
    expect(roundsFor(wanted, wanted)).toBe(2);
    expect(roundsFor(12345, 12345 + 1900)).toBe(2);
  }
});

it("words a pixel are those of the shaders", () => {
  expect([gatheredWords(16), gatheredWords(8), gatheredWords(0)]).toEqual([10, 6, 2]);
  expect(shader(["depth_bins"], tailOf("density-8", 0)!)).toContain("const BINS = 8u;");
  expect(() => shader(["nothing"])).toThrow();
});

it("every tail has shaders of its own, whatever its constant", () => {
  for (const name of ["exact-coverage", "density", "weighted-average", "paper", "density-8", "density-16"]) {
    const { bins } = tailOf(name, 1)!;
    const text = shader([], tailOf(name, 1e300)!);
    expect(text).toContain(`const TAIL = ${bins ? "BINNED" : name.toUpperCase().replace("-", "_")};`);
    expect(text).toContain("const DENSITY_G = f32(1e+30);");
  }
  expect(tailOf("toString", 1)).toBeNull();
});

it("triangles are drawn in runs that cover about as much, all of them once", () => {
  const full = 2 ** 24;
  expect(runsOf([1, 2, 3], 500)).toEqual([{ first: 0, end: 500 }]);
  expect(runsOf([full, 0, 1, full / 2, full], 900)).toEqual([
    { first: 0, end: 384 },
    { first: 384, end: 768 },
    { first: 768, end: 900 },
  ]);
});
