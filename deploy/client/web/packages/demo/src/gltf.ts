// Binary glTF to a scene: geometry, transforms, base colour and opacity, which is all that is rendered
// (renderer/convert.py reads the same).

import { type Document, type Material, type Primitive, type Texture, WebIO, Logger } from "@gltf-transform/core";

import {
  type Batch,
  cofactors,
  cross,
  encodeGamma2,
  type Image,
  type Layer,
  type Mat4,
  orient,
  product,
  scaled,
  type Scene,
  subtract,
  transformed,
  Trouble,
  unit,
  type Vec3,
} from "@diaphane/core";

const MOST_VERTICES = 4_000_000;
const MOST_CORNERS = 6 * MOST_VERTICES;
/** Of all accessors: those without data, or with the same, take no room in a file. */
const MOST_ELEMENTS = 32_000_000;
/** Of all images, decoded: 4 bytes each. */
const MOST_TEXELS = 2 ** 28;
const MOST_BYTES = 256 * 2 ** 20;
const TRIANGLES = 4;
const STRIP = 5;
const FAN = 6;
const WRAPS: Record<number, GPUAddressMode> = { 33071: "clamp-to-edge", 33648: "mirror-repeat", 10497: "repeat" };
const LAYERS: readonly Layer[] = ["opaque", "mixed", "transparent"];

/** Extensions without which a file still looks about as it should. */
const HARMLESS = /^KHR_(mesh_quantization|materials_(?!pbrSpecularGlossiness).*)$/;

interface Look {
  readonly layer: Layer;
  readonly image: Image | null;
  readonly scale: readonly [number, number, number, number];
  readonly threshold: number;
  /** Linear RGB and opacity of the vertices; white where there is an image. */
  readonly base: readonly [number, number, number, number];
  readonly uv: string;
}

/** A primitive's vertices and corners in its own space. */
interface Mesh {
  readonly points: Vec3[];
  readonly normals: Vec3[];
  readonly uvs: (readonly [number, number])[];
  readonly corners: number[];
}

/** A mesh where it stands: vertices in world space, float64. */
interface Placed {
  readonly points: Vec3[];
  readonly normals: Vec3[];
  readonly mesh: Mesh;
  readonly look: Look;
}

/**
 * Reads a .glb file.
 *
 * @param name Short name of the scene.
 * @param file Its content; nothing of it is read if it is too large.
 * @throws Trouble It is damaged, has nothing to draw, or needs what is not supported.
 */
export async function readGlb(name: string, file: Blob): Promise<Scene> {
  if (file.size > MOST_BYTES) {
    throw new Trouble(`${name} is larger than ${MOST_BYTES / 2 ** 20} MiB.`, "Open a smaller file.");
  }
  const bytes = await file.arrayBuffer().catch(() => {
    throw new Trouble(`${name} cannot be read.`, "It may be a folder, or have changed on the disk: choose it again.");
  });
  try {
    const placed = await place(name, await parse(name, new Uint8Array(bytes)));
    if (placed.every((one) => one.mesh.corners.length === 0))
      throw new Trouble(`${name} has nothing to draw.`, "Check that it has meshes of triangles in a scene.");
    return assemble(name, placed);
  } catch (error) {
    if (!(error instanceof RangeError)) throw error; // of an array's length
    throw new Trouble(`${name} is too large.`, "Open a smaller file.");
  }
}

async function parse(name: string, bytes: Uint8Array<ArrayBuffer>): Promise<Document> {
  try {
    const io = new WebIO().setLogger(new Logger(Logger.Verbosity.SILENT));
    const json = await io.binaryToJSON(bytes);
    const unknown = (json.json.extensionsRequired ?? []).filter((each) => !HARMLESS.test(each));
    if (unknown.length > 0) {
      throw new Trouble(`${name} needs ${unknown.join(", ")}, which is not supported here.`, "Export it without.");
    }
    json.json.extensionsRequired = [];
    const counts = (json.json.accessors ?? []).map(({ count }) => count);
    if (!counts.every((count) => Number.isInteger(count) && count > 0)) throw new Error("a count is none");
    const elements = counts.reduce((sum, count) => sum + count, 0);
    if (elements > MOST_ELEMENTS) throw tooLarge(name, elements, "elements of attributes and indices");
    return await io.readJSON(json);
  } catch (error) {
    if (error instanceof Trouble) throw error;
    throw new Trouble(
      `${name} cannot be read as binary glTF.`,
      "Check it with a glTF validator; it has to be one .glb file.",
    );
  }
}

const tooLarge = (name: string, count: number, what: string): Trouble =>
  new Trouble(`${name} has ${count.toLocaleString("en")} ${what} or more.`, "Open a smaller file.");

async function place(name: string, document: Document): Promise<Placed[]> {
  const root = document.getRoot();
  const shown = root.getDefaultScene() ?? root.listScenes()[0];
  const looks = new Map<Material | null, Look>();
  const meshes = new Map<Primitive, Mesh>();
  const images = new Map<Texture, ImageBitmap>();
  const waiting: { primitive: Primitive; matrix: Mat4 }[] = [];
  const nodes = (shown?.listChildren() ?? []).map((node) => ({ node, matrix: node.getMatrix() as Mat4 }));
  let [vertices, corners] = [0, 0];
  for (const { node, matrix } of nodes) {
    for (const child of node.listChildren()) nodes.push({ node: child, matrix: product(matrix, child.getMatrix()) });
    for (const primitive of node.getMesh()?.listPrimitives() ?? []) {
      if (![TRIANGLES, STRIP, FAN].includes(primitive.getMode()) || !primitive.getAttribute("POSITION")) continue;
      // Before anything is unpacked, and as often as it is placed: many nodes may have one mesh.
      const size = sizeOf(primitive);
      vertices += size.vertices;
      corners += size.corners;
      if (vertices > MOST_VERTICES) throw tooLarge(name, vertices, "vertices");
      if (corners > MOST_CORNERS) throw tooLarge(name, Math.floor(corners / 3), "triangles");
      waiting.push({ primitive, matrix });
    }
  }
  const placed: Placed[] = [];
  for (const { primitive, matrix } of waiting) {
    const material = primitive.getMaterial();
    if (!looks.has(material)) looks.set(material, await lookOf(name, material, images));
    const look = looks.get(material)!;
    if (!meshes.has(primitive)) meshes.set(primitive, meshOf(primitive, look.uv));
    const mesh = meshes.get(primitive)!;
    const rows = cofactors(matrix);
    const turn = (v: Vec3): Vec3 =>
      unit([0, 1, 2].map((c) => rows[0][c]! * v[0] + rows[1][c]! * v[1] + rows[2][c]! * v[2]) as unknown as Vec3);
    placed.push({
      points: mesh.points.map((p) => transformed(matrix, p)),
      normals: mesh.normals.map(turn),
      mesh,
      look,
    });
  }
  return placed;
}

async function lookOf(name: string, material: Material | null, images: Map<Texture, ImageBitmap>): Promise<Look> {
  const mode = material?.getAlphaMode() ?? "OPAQUE";
  const factor = (material?.getBaseColorFactor() ?? [1, 1, 1, 1]).map((x) => Math.min(Math.max(x, 0), 1));
  const scale = factor as unknown as Look["scale"];
  const image = material ? await imageOf(name, material, images) : null;
  const threshold = mode === "MASK" ? (material?.getAlphaCutoff() ?? 0.5) : 0;
  const alpha = Math.floor(scale[3] * 255 + 0.5);
  let layer: Layer = image || mode === "MASK" || alpha === 255 ? "mixed" : "transparent";
  if (mode === "OPAQUE" || (!image && alpha === 255)) layer = "opaque";
  const coordinates = material?.getBaseColorTextureInfo()?.getTexCoord() === 1 ? 1 : 0;
  const white = [1, 1, 1, 1] as const;
  const uv = `TEXCOORD_${coordinates}`;
  return { layer, image, scale: image ? scale : white, threshold, base: image ? white : scale, uv };
}

async function imageOf(name: string, material: Material, images: Map<Texture, ImageBitmap>): Promise<Image | null> {
  const texture = material.getBaseColorTexture();
  const content = texture?.getImage();
  if (!texture || !content) return null;
  let pixels = images.get(texture);
  if (!pixels) {
    const blob = new Blob([content as Uint8Array<ArrayBuffer>], { type: texture.getMimeType() });
    try {
      const sizes = [texture.getSize() ?? [0, 0], ...[...images.values()].map(({ width, height }) => [width, height])];
      const texels = sizes.reduce((sum, [width, height]) => sum + width! * height!, 0);
      if (texels > MOST_TEXELS) throw tooLarge(name, texels, "pixels of images");
      pixels = await createImageBitmap(blob, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
    } catch (error) {
      if (error instanceof Trouble) throw error;
      throw new Trouble(`An image in ${name} cannot be read.`, "Export it with PNG or JPEG images.");
    }
    images.set(texture, pixels);
  }
  const info = material.getBaseColorTextureInfo();
  const wrap = [info?.getWrapS(), info?.getWrapT()].map((each) => WRAPS[each ?? 10497] ?? "repeat");
  return { pixels, wrap: wrap as unknown as Image["wrap"] };
}

/** What `meshOf` makes of it, at most. */
function sizeOf(primitive: Primitive): { vertices: number; corners: number } {
  const points = primitive.getAttribute("POSITION")!.getCount();
  const listed = primitive.getIndices()?.getCount() ?? points;
  const corners = primitive.getMode() === TRIANGLES ? listed : 3 * listed;
  const normals = primitive.getAttribute("NORMAL");
  const isFaceted = normals?.getCount() !== points || normals.getElementSize() < 3;
  return { vertices: isFaceted ? Math.max(points, corners) : points, corners };
}

function meshOf(primitive: Primitive, uv: string): Mesh {
  const count = primitive.getAttribute("POSITION")!.getCount();
  const attribute = (name: string, width: number): number[][] => {
    const accessor = primitive.getAttribute(name);
    if (accessor?.getCount() !== count || accessor.getElementSize() < width) return [];
    return Array.from({ length: count }, (_, i) => accessor.getElement(i, []).slice(0, width));
  };
  const points = attribute("POSITION", 3) as unknown as Vec3[];
  const indices = primitive.getIndices();
  const listed = indices ? Array.from<number>(indices.getArray() ?? []) : points.map((_, i) => i);
  const mesh: Mesh = {
    points,
    normals: attribute("NORMAL", 3) as unknown as Vec3[],
    uvs: attribute(uv, 2) as unknown as [number, number][],
    corners: triangles(listed, primitive.getMode(), points.length),
  };
  return mesh.normals.length === points.length ? mesh : faceted(mesh);
}

/** Corners of a list, strip or fan of triangles; those without a vertex are left out. How they wind does not matter. */
function triangles(listed: readonly number[], mode: number, vertices: number): number[] {
  const corners: number[] = [];
  const step = mode === TRIANGLES ? 3 : 1;
  for (let i = 2; i < listed.length; i += step) {
    const corner = [mode === FAN ? listed[0]! : listed[i - 2]!, listed[i - 1]!, listed[i]!];
    if (corner.every((each) => each < vertices)) corners.push(...corner);
  }
  return corners;
}

/** A mesh without normals has flat faces (glTF 2.0, section 3.7.2.1): every corner becomes a vertex. */
function faceted(mesh: Mesh): Mesh {
  const points = mesh.corners.map((corner) => mesh.points[corner]!);
  const normals = points.map((_, i): Vec3 => {
    const [a, b, c] = [0, 1, 2].map((j) => points[i - (i % 3) + j]!) as [Vec3, Vec3, Vec3];
    return unit(cross(subtract(b, a), subtract(c, a)));
  });
  const uvs = mesh.uvs.length ? mesh.corners.map((corner) => mesh.uvs[corner]!) : [];
  return { points, normals, uvs, corners: points.map((_, i) => i) };
}

function assemble(name: string, placed: readonly Placed[]): Scene {
  const low: [number, number, number] = [Infinity, Infinity, Infinity];
  const high: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  for (const { points } of placed) {
    for (const point of points) {
      for (let c = 0; c < 3; ++c) {
        low[c] = Math.min(low[c]!, point[c]!);
        high[c] = Math.max(high[c]!, point[c]!);
      }
    }
  }
  const origin = scaled([low[0] + high[0], low[1] + high[1], low[2] + high[2]], 0.5);
  if (![...origin, ...subtract(high, origin)].every((each) => Number.isFinite(Math.fround(each)))) {
    throw new Trouble(`${name} has points that are not finite.`, "Look for NaN or huge numbers in it.");
  }
  const vertices = placed.reduce((sum, one) => sum + one.points.length, 0);
  const corners = placed.reduce((sum, one) => sum + one.mesh.corners.length, 0);
  const scene = {
    name,
    positions: new Float32Array(3 * vertices),
    normals: new Float32Array(3 * vertices),
    uvs: new Float32Array(2 * vertices),
    colours: new Uint8Array(4 * vertices),
    indices: new Uint32Array(corners),
    up: [0, 1, 0] as const,
  };
  const batches = fill(scene, placed, origin);
  orient(scene.positions, scene.normals, scene.indices);
  return { ...scene, batches, bounds: [subtract(low, origin), subtract(high, origin)] };
}

function fill(
  scene: Pick<Scene, "positions" | "normals" | "uvs" | "colours" | "indices">,
  placed: readonly Placed[],
  origin: Vec3,
): Batch[] {
  // Without an image the colour is in the vertices: materials that differ in nothing else are drawn together.
  const groups = new Map<Look | string, [Placed, ...Placed[]]>();
  for (const one of placed) {
    const key = one.look.image ? one.look : `${one.look.layer} ${one.look.threshold}`;
    const group = groups.get(key);
    if (group) group.push(one);
    else groups.set(key, [one]);
  }
  const batches: Batch[] = [];
  let vertex = 0;
  let index = 0;
  for (const group of [...groups.values()].sort((a, b) => order(a[0].look) - order(b[0].look))) {
    const first = index;
    for (const { points, normals, mesh, look } of group) {
      const stored = [...look.base.slice(0, 3).map(encodeGamma2), Math.floor(look.base[3] * 255 + 0.5)];
      for (const corner of mesh.corners) scene.indices[index++] = vertex + corner;
      points.forEach((point, i) => {
        scene.positions.set(subtract(point, origin), 3 * vertex);
        scene.normals.set(normals[i]!, 3 * vertex);
        scene.uvs.set(mesh.uvs[i] ?? [0, 0], 2 * vertex);
        scene.colours.set(stored, 4 * vertex);
        ++vertex;
      });
    }
    const { layer, image, scale, threshold } = group[0].look;
    batches.push({ first, count: index - first, layer, image, scale, threshold });
  }
  return batches.filter((batch) => batch.count > 0);
}

const order = (look: Look): number => LAYERS.indexOf(look.layer);
