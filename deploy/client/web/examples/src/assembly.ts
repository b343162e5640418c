// A gearbox under x-rays: every part is transparent, and the parts lie within each other.

import { diaphanePass } from "@diaphane/three";
import {
  BoxGeometry,
  type BufferGeometry,
  CylinderGeometry,
  DoubleSide,
  ExtrudeGeometry,
  Group,
  LatheGeometry,
  Mesh,
  MeshStandardMaterial,
  Shape,
  TorusGeometry,
  Vector2,
} from "three/webgpu";
import { choosing } from "./choosing";
import { Frame } from "./frame";
import { studio } from "./studio";

const { scene, camera } = studio("#10161d", [2.6, 1.5, 4.2]);
const pass = diaphanePass(scene, camera, { technique: "kbuffer", budget: 4 });

const part = (geometry: BufferGeometry, color: string, opacity: number): Mesh =>
  new Mesh(geometry, new MeshStandardMaterial({ color, opacity, transparent: true, side: DoubleSide, forceSinglePass: true, metalness: 0.2 }));

/** A wheel with teeth and a bore; its axis is z. */
function wheel(teeth: number, radius: number, thickness: number): BufferGeometry {
  const outline = new Shape();
  for (let i = 0; i < 4 * teeth; i++) {
    const angle = (2 * Math.PI * (i + 0.5)) / (4 * teeth);
    const r = i % 4 < 2 ? radius : 0.86 * radius;
    outline.lineTo(r * Math.cos(angle), r * Math.sin(angle));
  }
  outline.holes.push(new Shape().absarc(0, 0, 0.28 * radius, 0, 2 * Math.PI));
  return new ExtrudeGeometry(outline, { depth: thickness, bevelEnabled: false, curveSegments: 16 }).translate(0, 0, -thickness / 2);
}

/** A shaft along z with its wheels and bearings. */
function shaft(x: number, wheels: readonly (readonly [z: number, teeth: number, radius: number, color: string])[]): Group {
  const made = new Group();
  const axle = part(new CylinderGeometry(0.11, 0.11, 3.1, 24), "#c9d2da", 0.45);
  axle.rotation.x = Math.PI / 2;
  made.add(axle);
  for (const [z, teeth, radius, color] of wheels) {
    const gear = part(wheel(teeth, radius, 0.3), color, 0.4);
    gear.position.z = z;
    made.add(gear);
  }
  for (const z of [-1.3, 1.3]) {
    const bearing = part(new TorusGeometry(0.2, 0.07, 12, 32), "#f2c14e", 0.5);
    bearing.position.z = z;
    made.add(bearing);
  }
  made.position.x = x;
  return made;
}

function bolts(): Group {
  const made = new Group();
  for (const x of [-1.25, 1.25])
    for (const z of [-1.2, -0.4, 0.4, 1.2]) {
      const bolt = part(new CylinderGeometry(0.07, 0.07, 0.5, 6), "#9fb3c8", 0.6);
      bolt.position.set(x, 0.05, z);
      made.add(bolt);
    }
  return made;
}

function housing(): Group {
  const made = new Group();
  for (const scale of [1, 0.94]) made.add(part(new BoxGeometry(3, 2 * scale, 2.9).scale(scale, 1, scale), "#5aa9e6", 0.14));
  const flange = part(new BoxGeometry(3.3, 0.16, 3.1), "#7fd1ae", 0.2);
  const profile = [[0.3, 0], [0.55, 0], [0.5, 0.25], [0.36, 0.3], [0.36, 0.6]].map(([r, y]) => new Vector2(r, y));
  const neck = part(new LatheGeometry(profile, 32), "#5aa9e6", 0.3);
  neck.position.set(0.62, 0, 1.42);
  neck.rotation.x = Math.PI / 2;
  made.add(flange, neck);
  return made;
}

const first = shaft(-0.62, [[-0.8, 14, 0.5, "#ef6f6c"], [0, 20, 0.72, "#f4a261"], [0.8, 17, 0.6, "#ef6f6c"]]);
const second = shaft(0.62, [[-0.8, 22, 0.78, "#8ecae6"], [0, 16, 0.56, "#b388eb"], [0.8, 19, 0.68, "#8ecae6"]]);
scene.add(housing(), first, second, bolts());
void Frame.open(() => ({ camera, output: () => pass }), (frame) => choosing(frame, pass));
