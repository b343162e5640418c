import { Mesh, MeshStandardMaterial, IcosahedronGeometry, TorusKnotGeometry } from "three/webgpu";
import { DoubleSide, HemisphereLight, PerspectiveCamera, Scene } from "three/webgpu";
import { diaphanePass } from "@diaphane/three";
const glass = (color: string) => new MeshStandardMaterial({ color, transparent: true, opacity: 0.5, side: DoubleSide });
export const [scene, camera] = [new Scene(), new PerspectiveCamera(45, 1, 0.1, 100)];
scene.add(new Mesh(new TorusKnotGeometry(), glass("tomato")));
scene.add(new Mesh(new IcosahedronGeometry(1.2, 4), glass("deepskyblue")));
scene.add(new HemisphereLight("white", "slategrey", 4));
camera.position.z = 5;
export const pass = diaphanePass(scene, camera, { budget: 4 }); // in the place of pass(scene, camera)
