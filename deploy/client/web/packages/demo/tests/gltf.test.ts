import { readFileSync } from "node:fs";
import { expect, it, vi } from "vitest";

import { framingView, length, subtract, turned } from "@diaphane/core";
import { readGlb } from "../src/gltf";

const sample = (name: string) => new Blob([readFileSync(new URL(`../../../samples/${name}.glb`, import.meta.url))]);

function glb(json: unknown): Blob {
  let text = JSON.stringify(json);
  text += " ".repeat(-text.length & 3);
  const file = Buffer.alloc(20 + text.length);
  file.write("glTF", 0);
  [2, file.length, text.length].forEach((word, i) => file.writeUInt32LE(word, 4 + 4 * i));
  file.write("JSON", 16);
  file.write(text, 20);
  return new Blob([file]);
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
  await expect(readGlb("x", new Blob([]))).rejects.toThrow("cannot be read");
  await expect(readGlb("x", glb({ asset, extensionsRequired: ["KHR_draco_mesh_compression"] }))).rejects.toThrow(
    "draco",
  );
  await expect(readGlb("x", glb({ asset, scenes: [{ nodes: [] }] }))).rejects.toThrow("nothing to draw");
  const refused = () => Promise.reject(new DOMException("no", "NotFoundError"));
  const folder = Object.assign(new Blob(["x"]), { arrayBuffer: refused });
  await expect(readGlb("x", folder)).rejects.toThrow("choose it again");
  const large = Object.defineProperty(new Blob(["x"]), "size", { value: 2 ** 32 });
  await expect(readGlb("x", large)).rejects.toThrow("larger than 256 MiB");
});

const TRIANGLE = Buffer.from(new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]).buffer).toString("base64");
const PRIMITIVE = { attributes: { POSITION: 0 }, material: 0 };

/** A glTF of one triangle, whose members may be others. */
function triangle(others: Record<string, unknown> = {}): Blob {
  return glb({
    asset: { version: "2.0" },
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [PRIMITIVE] }],
    materials: [{ alphaMode: "BLEND", pbrMetallicRoughness: { baseColorFactor: [1, 0, 0, 0.5] } }],
    accessors: [{ bufferView: 0, componentType: 5126, count: 3, type: "VEC3" }],
    bufferViews: [{ buffer: 0, byteLength: 36 }],
    buffers: [{ byteLength: 36, uri: `data:application/octet-stream;base64,${TRIANGLE}` }],
    ...others,
  });
}

it("counts that no file means, points nowhere and meshes without triangles are refused, at once", async () => {
  const accessor = { bufferView: 0, componentType: 5126, count: 3, type: "VEC3" };
  const without = { componentType: 5126, count: 300_000_000, type: "VEC3" };
  await expect(readGlb("x", triangle({ accessors: [without] }))).rejects.toThrow("300,000,000 elements");
  await expect(readGlb("x", triangle({ accessors: [{ ...without, count: 4e9 }] }))).rejects.toThrow("elements");
  await expect(readGlb("x", triangle({ accessors: [without, { ...without, count: -3e8 }] }))).rejects.toThrow("read");
  const unpacked = readGlb("x", triangle({ accessors: [{ ...without, count: 30_000_000 }] }));
  await expect(unpacked).rejects.toThrow("30,000,000 vertices");
  const indexed = [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }];
  const corners = { ...without, componentType: 5125, type: "SCALAR", count: 20_000_000 };
  const faceted = readGlb("x", triangle({ meshes: indexed, accessors: [accessor, corners] }));
  await expect(faceted).rejects.toThrow("20,000,000 vertices");
  const many = Array.from({ length: 3000 }, () => ({ mesh: 0 }));
  const scenes = [{ nodes: many.map((_, i) => i) }];
  const large = { componentType: 5126, count: 30_000, type: "VEC3" };
  await expect(readGlb("x", triangle({ scenes, nodes: many, accessors: [large] }))).rejects.toThrow("vertices");
  await expect(readGlb("x", triangle({ nodes: [{ mesh: 0, scale: [1e39, 1, 1] }] }))).rejects.toThrow("finite");
  const normals = [{ primitives: [{ attributes: { POSITION: 0, NORMAL: 0 } }] }];
  const two = { meshes: normals, accessors: [{ ...accessor, count: 2 }] };
  await expect(readGlb("x", triangle(two))).rejects.toThrow("nothing to draw");
}, 20_000);

it("nodes move what is in them, however deep", async () => {
  const quarter = [0, 0, Math.SQRT1_2, Math.SQRT1_2];
  const nodes = [{ children: [1], scale: [1, 4, 1] }, { mesh: 0, rotation: quarter }];
  const { bounds } = await readGlb("x", triangle({ nodes }));
  [0.5, 2, 0].forEach((half, c) => expect(bounds[1][c]).toBeCloseTo(half, 12));
  const chain = Array.from({ length: 9_000 }, (_, i) => ({ mesh: 0, children: i < 8_999 ? [i + 1] : [] }));
  expect((await readGlb("x", triangle({ nodes: chain }))).indices.length).toBe(27_000);
}, 20_000);

it("materials that differ in colour alone are drawn together, each in its colour", async () => {
  const count = 2_000;
  const meshes = [{ primitives: Array.from({ length: count }, (_, material) => ({ ...PRIMITIVE, material })) }];
  const red = (i: number) => ({ pbrMetallicRoughness: { baseColorFactor: [i % 2, 0, 0, 0.5] } });
  const materials = Array.from({ length: count }, (_, i) => ({ alphaMode: i < 10 ? "OPAQUE" : "BLEND", ...red(i) }));
  const { batches, colours } = await readGlb("x", triangle({ meshes, materials }));
  expect(batches.map(({ layer, first, count }) => [layer, first, count])).toEqual([
    ["opaque", 0, 30],
    ["transparent", 30, 3 * count - 30],
  ]);
  expect([0, 3, 6].map((vertex) => colours[4 * vertex])).toEqual([0, 255, 0]);
}, 20_000);

it("an image that is none is refused with a remedy", async () => {
  vi.stubGlobal("createImageBitmap", () => Promise.reject(new DOMException("no", "InvalidStateError")));
  const materials = [{ pbrMetallicRoughness: { baseColorTexture: { index: 0 } } }];
  const images = [{ bufferView: 0, mimeType: "image/png" }];
  const textures = [{ source: 0 }];
  await expect(readGlb("x", triangle({ materials, images, textures }))).rejects.toThrow("An image in x");
  const header = Buffer.alloc(36);
  header.write("89504e470d0a1a0a0000000d49484452", "hex");
  [16, 20].forEach((at) => header.writeUInt32BE(30_000, at));
  const buffers = [{ byteLength: 36, uri: `data:application/octet-stream;base64,${header.toString("base64")}` }];
  const accessors = [{ componentType: 5126, count: 3, type: "VEC3" }];
  const vast = readGlb("x", triangle({ materials, images, textures, buffers, accessors }));
  await expect(vast).rejects.toThrow("900,000,000 pixels");
  vi.unstubAllGlobals();
});

it("an image of many materials is decoded once", async () => {
  const decode = vi.fn(() => Promise.resolve({ width: 1, height: 1 }));
  vi.stubGlobal("createImageBitmap", decode);
  const look = (shade: number) => ({ baseColorTexture: { index: 0 }, baseColorFactor: [shade, 1, 1, 1] });
  const materials = [0.25, 0.5].map((shade) => ({ pbrMetallicRoughness: look(shade) }));
  const meshes = [{ primitives: [0, 1].map((material) => ({ ...PRIMITIVE, material })) }];
  const images = [{ bufferView: 0, mimeType: "image/png" }];
  const { batches } = await readGlb("x", triangle({ materials, meshes, images, textures: [{ source: 0 }] }));
  expect(batches.map(({ scale }) => scale[0])).toEqual([0.25, 0.5]);
  expect(decode).toHaveBeenCalledOnce();
  vi.unstubAllGlobals();
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
