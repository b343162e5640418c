// A scene with light and a camera, and numbers that are the same every time.

import { Color, DirectionalLight, HemisphereLight, PerspectiveCamera, Scene } from "three/webgpu";

export interface Studio {
  readonly scene: Scene;
  readonly camera: PerspectiveCamera;
}

/** @param background Any colour of CSS. */
export function studio(background: string, position: readonly [number, number, number]): Studio {
  const scene = new Scene();
  scene.background = new Color(background);
  const sun = new DirectionalLight(0xffffff, 2.5);
  sun.position.set(2, 3, 4);
  scene.add(new HemisphereLight(0xffffff, 0x667788, 1.5), sun);
  const camera = new PerspectiveCamera(40, 1, 0.1, 100);
  camera.position.set(...position);
  return { scene, camera };
}

/** Numbers in [0, 1). */
export function random(seed: number): () => number {
  let state = seed;
  return () => (state = (state * 16807) % 2147483647) / 2147483647;
}
