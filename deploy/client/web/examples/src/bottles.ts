// A shelf of bottles: a file of glTF, whose materials are as three.js's loader makes them.

import shelf from "../../samples/shelf.glb?url";
import { Trouble } from "@diaphane/core";
import { diaphanePass } from "@diaphane/three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { Box3, Vector3 } from "three/webgpu";
import { choosing } from "./choosing";
import { Frame } from "./frame";
import { studio } from "./studio";

const { scene, camera } = studio("#d8dfe6", [0, 0, 1]);
const pass = diaphanePass(scene, camera);

async function fetched() {
  const { scene: bottles } = await new GLTFLoader().loadAsync(shelf).catch(() => {
    throw new Trouble("The bottles could not be fetched.", "Load the page again.");
  });
  scene.add(bottles);
  const box = new Box3().setFromObject(bottles);
  const [target, size] = [box.getCenter(new Vector3()), box.getSize(new Vector3())];
  camera.position.copy(target).add(new Vector3(0.25, 0.2, 1.15).multiplyScalar(Math.max(size.x, size.y)));
  return { camera, target, output: () => pass };
}

void Frame.open(fetched, (frame) => choosing(frame, pass), "The bottles are being fetched.");
