// Left three.js's weighted-blended pass, right ours: the same scene, camera and materials.

import { diaphanePass } from "@diaphane/three";
import { oitPass } from "three/addons/tsl/display/OITPassNode.js";
import { screenUV, uniform } from "three/tsl";
import { DoubleSide, IcosahedronGeometry, Mesh, MeshStandardMaterial, SphereGeometry, TorusGeometry } from "three/webgpu";
import { choosing } from "./choosing";
import { at, Frame } from "./frame";
import { studio } from "./studio";

const { scene, camera } = studio("#eef1f4", [0.8, 1, 4.6]);
const shell = (radius: number, color: string, opacity: number): Mesh =>
  new Mesh(new IcosahedronGeometry(radius, 6), new MeshStandardMaterial({ color, opacity, transparent: true, side: DoubleSide, forceSinglePass: true }));
scene.add(new Mesh(new SphereGeometry(0.25, 32, 24), new MeshStandardMaterial({ color: "#222222" })));
scene.add(shell(1.3, "#2a9d8f", 0.35), shell(0.95, "#e9c46a", 0.5), shell(0.6, "#e63946", 0.6));
for (const [turn, color] of [[0, "#4361ee"], [1.57, "#7209b7"]] as const) {
  const material = new MeshStandardMaterial({ color, opacity: 0.7, transparent: true, side: DoubleSide, forceSinglePass: true });
  const ring = new Mesh(new TorusGeometry(1.45, 0.12, 16, 64), material);
  ring.rotation.set(turn, 0.6, 0.3);
  scene.add(ring);
}

const place = uniform(0.5);
const pass = diaphanePass(scene, camera, { technique: "kbuffer", budget: 8 });
const output = () => screenUV.x.lessThan(place).select(oitPass(scene, camera), pass);

const split = at<HTMLInputElement>("split");
const move = (frame: Frame): void => {
  place.value = Number(split.value) / 100;
  at("line").style.left = `${split.value}%`;
  frame.redraw();
};

const ready = (frame: Frame): void => {
  choosing(frame, pass);
  split.addEventListener("input", () => move(frame));
  at("stage").addEventListener("keydown", ({ key }) => {
    if (key !== "[" && key !== "]") return;
    split.valueAsNumber += key === "[" ? -2 : 2;
    move(frame);
  });
  move(frame);
};

void Frame.open(() => ({ camera, output }), ready);
