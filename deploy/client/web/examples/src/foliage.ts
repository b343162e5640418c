// A shrub of leaves, drawn as instances of one card whose texture fades out: no order of objects is right, since there
// is one object.

import { diaphanePass } from "@diaphane/three";
import {
  Color,
  CylinderGeometry,
  DataTexture,
  DoubleSide,
  InstancedMesh,
  LinearFilter,
  Mesh,
  MeshStandardMaterial,
  Object3D,
  PlaneGeometry,
  RGBAFormat,
  SRGBColorSpace,
} from "three/webgpu";
import { choosing } from "./choosing";
import { Frame } from "./frame";
import { random, studio } from "./studio";

const LEAVES = 700;
const TEXELS = 64;

/** Two arcs that meet, with a vein, fading out at the edge. */
function leaf(): DataTexture {
  const texels = new Uint8Array(4 * TEXELS * TEXELS);
  for (let i = 0; i < TEXELS * TEXELS; i++) {
    const [x, y] = [(2 * ((i % TEXELS) + 0.5)) / TEXELS - 1, (Math.floor(i / TEXELS) + 0.5) / TEXELS];
    const half = 0.7 * Math.sin(Math.PI * y) ** 0.8;
    const within = Math.min(Math.max((half - Math.abs(x)) * 5, 0), 1);
    const vein = Math.abs(x) < 0.04 ? 30 : 0;
    texels.set([90 + vein, 150 + vein, 60 + vein, 215 * within], 4 * i);
  }
  const map = new DataTexture(texels, TEXELS, TEXELS, RGBAFormat);
  Object.assign(map, { colorSpace: SRGBColorSpace, magFilter: LinearFilter, minFilter: LinearFilter, needsUpdate: true });
  return map;
}

function shrub() {
  const { scene, camera } = studio("#dfe8ee", [0, 0.5, 4.4]);
  const material = new MeshStandardMaterial({ map: leaf(), transparent: true, side: DoubleSide, forceSinglePass: true, roughness: 0.7 });
  const leaves = new InstancedMesh(new PlaneGeometry(0.34, 0.5), material, LEAVES);
  const next = random(5);
  const place = new Object3D();
  for (let i = 0; i < LEAVES; i++) {
    const [around, up, out] = [2 * Math.PI * next(), 2 * next() - 1, next() ** 0.4];
    place.position.set(Math.cos(around) * Math.sqrt(1 - up * up), up, Math.sin(around) * Math.sqrt(1 - up * up));
    place.position.multiplyScalar(1.1 * out);
    place.rotation.set(3 * next(), 6 * next(), 3 * next());
    place.scale.setScalar(0.6 + 0.6 * next());
    place.updateMatrix();
    leaves.setMatrixAt(i, place.matrix);
    leaves.setColorAt(i, new Color().setHSL(0.2 + 0.12 * next(), 0.6, 0.5 + 0.25 * next()));
  }
  const stem = new Mesh(new CylinderGeometry(0.05, 0.08, 2.4), new MeshStandardMaterial({ color: "#6b4a2f" }));
  stem.position.y = -0.6;
  scene.add(leaves, stem);
  const pass = diaphanePass(scene, camera);
  return { camera, pass, output: () => pass };
}

const example = shrub();
void Frame.open(() => example, (frame) => choosing(frame, example.pass));
