// What pictures are compared of: each scene has something else that a material or an object can be.

import { GLTFExporter } from "three/addons/exporters/GLTFExporter.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import {
  Bone,
  BoxGeometry,
  Color,
  CylinderGeometry,
  DataTexture,
  DirectionalLight,
  DoubleSide,
  Float32BufferAttribute,
  Fog,
  HemisphereLight,
  IcosahedronGeometry,
  InstancedMesh,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshPhysicalMaterial,
  MeshStandardMaterial,
  Object3D,
  PerspectiveCamera,
  PlaneGeometry,
  Scene,
  Skeleton,
  SkinnedMesh,
  SphereGeometry,
  TorusKnotGeometry,
  Uint16BufferAttribute,
  Vector3,
} from "three/webgpu";

export interface Sample {
  readonly scene: Scene;
  readonly camera: PerspectiveCamera;
}

/** Numbers in [0, 1), the same every time. */
function random(seed: number): () => number {
  let state = seed;
  return () => (state = (state * 16807) % 2147483647) / 2147483647;
}

function lit(z: number, background = 0x223344): Sample {
  const scene = new Scene();
  scene.background = new Color(background);
  const sun = new DirectionalLight(0xffffff, 2.5);
  sun.position.set(2, 3, 4);
  scene.add(new HemisphereLight(0xffffff, 0x445566, 1.2), sun);
  const camera = new PerspectiveCamera(45, 4 / 3, 0.1, 100);
  camera.position.set(0, 0.4, z);
  camera.lookAt(0, 0, 0);
  return { scene, camera };
}

/** Knots and boxes that pass through each other and through something opaque; one shows both of its sides. */
function primitives(): Sample {
  const sample = lit(5);
  const add = (mesh: Mesh, x: number, y: number, z: number): void => {
    mesh.position.set(x, y, z);
    mesh.rotation.set(x + 0.3, y + 0.2, z);
    sample.scene.add(mesh);
  };
  const glass = (color: number, opacity: number, more = {}): MeshStandardMaterial =>
    new MeshStandardMaterial({ color, opacity, transparent: true, roughness: 0.4, ...more });
  add(new Mesh(new SphereGeometry(0.7, 32, 24), new MeshStandardMaterial({ color: 0xcc8844 })), 0.3, -0.2, -0.4);
  add(new Mesh(new TorusKnotGeometry(0.9, 0.25, 96, 12), glass(0xff4444, 0.45)), 0, 0, 0);
  add(new Mesh(new BoxGeometry(1.6, 1.6, 1.6), glass(0x44ff66, 0.3, { side: DoubleSide })), -0.5, 0.2, 0.3);
  add(new Mesh(new IcosahedronGeometry(1, 3), glass(0x5588ff, 0.5)), 0.8, 0.1, 0.2);
  const coated = new MeshPhysicalMaterial({ color: 0xffee88, opacity: 0.6, transparent: true, clearcoat: 1 });
  add(new Mesh(new PlaneGeometry(3, 1.5), coated), 0, -0.3, 0.6);
  return sample;
}

/** Many of one geometry, each in its place and colour, in a fog. */
function instanced(): Sample {
  const sample = lit(6, 0x8899aa);
  sample.scene.fog = new Fog(0x8899aa, 4, 10);
  const material = new MeshStandardMaterial({ opacity: 0.4, transparent: true, side: DoubleSide, forceSinglePass: true });
  const mesh = new InstancedMesh(new SphereGeometry(0.45, 20, 14), material, 40);
  const next = random(7);
  for (let i = 0; i < mesh.count; i++) {
    const at = new Vector3(next() - 0.5, next() - 0.5, next() - 0.5).multiplyScalar(4);
    mesh.setMatrixAt(i, new Matrix4().setPosition(at));
    mesh.setColorAt(i, new Color().setHSL(next(), 0.8, 0.5));
  }
  sample.scene.add(mesh);
  return sample;
}

/** Vertex colours with opacities, and a texture that is cut out. */
function textured(): Sample {
  const sample = lit(4.5, 0xeeeeee);
  const size = 16;
  const texels = new Uint8Array(4 * size * size);
  for (let i = 0; i < size * size; i++) {
    const isOdd = ((i % size >> 2) + ((i / size) >> 2)) % 2 === 1;
    texels.set(isOdd ? [255, 255, 255, 230] : [40, 90, 200, 90], 4 * i);
  }
  const map = new DataTexture(texels, size, size);
  map.needsUpdate = true;
  const leaves = new MeshBasicMaterial({ map, transparent: true, side: DoubleSide, alphaTest: 0.05 });
  for (let i = 0; i < 5; i++) {
    const leaf = new Mesh(new PlaneGeometry(2.2, 2.2), leaves);
    leaf.rotation.y = (i * Math.PI) / 5;
    sample.scene.add(leaf);
  }
  const ball = new SphereGeometry(1, 24, 16);
  const count = ball.getAttribute("position").count;
  const next = random(3);
  const colours = Float32Array.from({ length: 4 * count }, (_, i) => (i % 4 === 3 ? 0.2 + 0.4 * next() : next()));
  ball.setAttribute("color", new Float32BufferAttribute(colours, 4));
  const painted = new MeshStandardMaterial({ vertexColors: true, transparent: true, side: DoubleSide });
  sample.scene.add(new Mesh(ball, painted));
  return sample;
}

/** A bent tube of two bones, twice; as glTF, written and read by three.js. */
async function skinned(): Promise<Sample> {
  const sample = lit(4.5);
  const geometry = new CylinderGeometry(0.5, 0.5, 2.4, 24, 12, true);
  const place = geometry.getAttribute("position");
  const share = Array.from({ length: place.count }, (_, i) => Math.min(Math.max(place.getY(i) / 2.4 + 0.5, 0), 1));
  geometry.setAttribute("skinIndex", new Uint16BufferAttribute(share.flatMap(() => [0, 1, 0, 0]), 4));
  geometry.setAttribute("skinWeight", new Float32BufferAttribute(share.flatMap((s) => [1 - s, s, 0, 0]), 4));
  const tubes = new Scene();
  for (const [i, color] of [0xff8822, 0x22aaff].entries()) {
    const material = new MeshStandardMaterial({ color, opacity: 0.5, transparent: true, side: DoubleSide });
    const mesh = new SkinnedMesh(geometry, material);
    const [root, tip] = [new Bone(), new Bone()];
    root.add(tip);
    mesh.add(root);
    mesh.bind(new Skeleton([root, tip]));
    tip.rotation.z = i ? -0.9 : 0.9;
    mesh.position.set(i ? 0.35 : -0.35, 0, i ? 0.1 : -0.1);
    tubes.add(mesh);
  }
  const file = (await new GLTFExporter().parseAsync(tubes, { binary: true })) as ArrayBuffer;
  sample.scene.add((await new GLTFLoader().parseAsync(file, "")).scene);
  return sample;
}

/** Faint sheets one behind the other, 64 of them, not in order. */
function sheets(): Sample {
  const sample = lit(5);
  const next = random(11);
  const geometry = new PlaneGeometry(2.4, 2.4);
  for (let i = 0; i < 64; i++) {
    const color = new Color().setHSL(next(), 0.9, 0.5);
    const mesh = new Mesh(geometry, new MeshBasicMaterial({ color, transparent: true, opacity: 0.02 + 0.1 * next() }));
    mesh.position.set(0.6 * (next() - 0.5), 0.6 * (next() - 0.5), -1.6 + ((i * 27) % 64) * 0.05);
    sample.scene.add(mesh);
  }
  return sample;
}

/** Four panes, in front of each other in an order of their own in each quarter: no order of objects is right. */
function panes(): Sample {
  const sample = lit(4);
  for (let i = 0; i < 4; i++) {
    const color = new Color().setHSL(i / 4, 1, 0.5);
    const pane = new Mesh(new PlaneGeometry(2.6, 0.7), new MeshBasicMaterial({ color, transparent: true, opacity: 0.6, side: DoubleSide }));
    pane.rotation.set(0, 0.35, (i * Math.PI) / 2, "ZYX");
    pane.position.set(...new Vector3(0, 0.7, 0).applyAxisAngle(Object3D.DEFAULT_UP.clone().set(0, 0, 1), (i * Math.PI) / 2).toArray());
    sample.scene.add(pane);
  }
  return sample;
}

export const SCENES: Readonly<Record<string, () => Sample | Promise<Sample>>> = { primitives, instanced, textured, skinned, sheets, panes };
