import { expect, it } from "vitest";

import { blocksOf, budgetOf } from "../src/passes/allocation";
import { runsOf, widened } from "../src/passes/geometry";
import { TAILS } from "../src/generated";
import { BLOCK, CEILING } from "../src/shaders";
import { DEFAULT_TAIL, FINEST_TAIL, tailOf } from "../src/tail";

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

it("tails are those with bins", () => {
  const binned = Object.keys(TAILS).filter((name) => tailOf(name) !== null);
  expect(binned).toEqual(Object.keys(TAILS).filter((name) => TAILS[name]!.kind === "BINNED"));
  expect(tailOf("toString")).toBeNull();
  expect(DEFAULT_TAIL.bins).toBeLessThan(FINEST_TAIL.bins);
});

it("a camera for whole tiles has the picture in its upper left", () => {
  const block = new Float32Array(44);
  for (const i of [0, 5, 15]) block[16 + i] = 1; // x, y and w as they are
  const found = new Float32Array(widened(block.buffer, [0.5, 0.8]));
  const clip = (x: number, y: number) => [0, 1].map((axis) => found[16 + axis]! * x + found[20 + axis]! * y + found[28 + axis]!);
  expect(clip(-1, 1)).toEqual([-1, 1].map((each) => expect.closeTo(each)));
  expect(clip(1, -1)).toEqual([0, -0.6].map((each) => expect.closeTo(each)));
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
