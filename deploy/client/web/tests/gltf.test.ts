import { readFileSync } from "node:fs";
import { expect, it } from "vitest";

import { framingView, turned } from "../src/camera";
import { readGlb } from "../src/gltf";
import { length, subtract } from "../src/math";

const sample = (name: string) =>
  new Uint8Array(readFileSync(new URL(`../samples/${name}.glb`, import.meta.url))) as Uint8Array<ArrayBuffer>;

function glb(json: unknown): Uint8Array<ArrayBuffer> {
  let text = JSON.stringify(json);
  text += " ".repeat(-text.length & 3);
  const file = Buffer.alloc(20 + text.length);
  file.write("glTF", 0);
  [2, file.length, text.length].forEach((word, i) => file.writeUInt32LE(word, 4 + 4 * i));
  file.write("JSON", 16);
  file.write(text, 20);
  return new Uint8Array(file) as Uint8Array<ArrayBuffer>;
}

it.each(["shells", "shelf"])("the sample %s is read", async (name) => {
  const scene = await readGlb(name, sample(name));
  expect(scene.batches[0]!.layer).toBe("opaque");
  expect(scene.batches.at(-1)!.layer).toBe("transparent");
  expect(scene.batches.reduce((sum, batch) => sum + batch.count, 0)).toBe(scene.indices.length);
  expect(Math.max(...scene.indices)).toBeLessThan(scene.positions.length / 3);
  for (const c of [0, 1, 2]) expect(scene.bounds[0][c]! + scene.bounds[1][c]!).toBeCloseTo(0, 12);
  const reach = scene.positions.reduce((most, x) => Math.max(most, Math.abs(x)), 0);
  expect(reach).toBeCloseTo(Math.max(...scene.bounds[1]), 5);
});

it("what is no glTF, needs too much or has nothing is refused with a remedy", async () => {
  const asset = { version: "2.0" };
  await expect(readGlb("x", sample("shells").slice(0, 400))).rejects.toThrow("cannot be read");
  await expect(readGlb("x", new Uint8Array(0))).rejects.toThrow("cannot be read");
  await expect(readGlb("x", glb({ asset, extensionsRequired: ["KHR_draco_mesh_compression"] }))).rejects.toThrow(
    "draco",
  );
  await expect(readGlb("x", glb({ asset, scenes: [{ nodes: [] }] }))).rejects.toThrow("nothing to draw");
});

it("turning keeps the distance, and stays short of the poles", () => {
  const view = framingView(
    [
      [-1, -1, -1],
      [1, 1, 1],
    ],
    [0, 1, 0],
    1.5,
  );
  const away = length(subtract(view.eye, view.target));
  const over = turned(view, 30, 400, 1);
  expect(length(subtract(over.eye, over.target))).toBeCloseTo(away, 10);
  expect(over.eye[1] / away).toBeCloseTo(Math.sin((85 * Math.PI) / 180), 10);
});
