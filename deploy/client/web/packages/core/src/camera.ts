// A view, its matrices (schemas/view.py: View), and a hand that turns it about its target.

import { type Mat4, type Vec3, add, cross, dot, length, scaled, subtract, unit } from "./math";

/** A pinhole camera, in metres relative to the scene's origin; `fov` is vertical, degrees. */
export interface View {
  readonly eye: Vec3;
  readonly target: Vec3;
  readonly up: Vec3;
  readonly fov: number;
}

export type Bounds = readonly [Vec3, Vec3];

interface Axes {
  readonly right: Vec3;
  readonly over: Vec3;
  readonly back: Vec3;
}

function axesOf(view: View): Axes {
  const back = unit(subtract(view.eye, view.target));
  const right = unit(cross(view.up, back));
  return { right, over: cross(back, right), back };
}

function corners(bounds: Bounds): Vec3[] {
  return Array.from({ length: 8 }, (_, i): Vec3 => [
    bounds[i & 1]![0],
    bounds[(i >> 1) & 1]![1],
    bounds[(i >> 2) & 1]![2],
  ]);
}

/** Near and far distance, metres, tight around the bounds. */
export function clipRange(view: View, bounds: Bounds): [number, number] {
  const { back } = axesOf(view);
  const depths = corners(bounds).map((corner) => dot(subtract(view.eye, corner), back));
  const diagonal = length(subtract(bounds[1], bounds[0])) || 1;
  const far = Math.max(Math.max(...depths) + 1e-3 * diagonal, 1e-3 * diagonal);
  const near = Math.max(Math.min(...depths) - 1e-3 * diagonal, 1e-4 * far);
  return [Math.min(near, 0.5 * far), far];
}

/**
 * The uniform block `Camera` of surface.wgsl.
 *
 * @param up Unit up axis of the scene.
 */
export function cameraBlock(view: View, bounds: Bounds, up: Vec3, width: number, height: number): ArrayBuffer {
  const { right, over, back } = axesOf(view);
  const [near, far] = clipRange(view, bounds);
  const f = 1 / Math.tan((view.fov * Math.PI) / 360);
  const aspect = width / height;
  const toView: Mat4 = [
    ...[right[0], over[0], back[0], 0],
    ...[right[1], over[1], back[1], 0],
    ...[right[2], over[2], back[2], 0],
    ...[-dot(right, view.eye), -dot(over, view.eye), -dot(back, view.eye), 1],
  ];
  // Clip z in [0, w], as WebGPU has it; row 0 is at the top.
  const projection: Mat4 = [
    ...[f / aspect, 0, 0, 0],
    ...[0, f, 0, 0],
    ...[0, 0, far / (near - far), -1],
    ...[0, 0, (near * far) / (near - far), 0],
  ];
  // Window coordinates to x/-z and y/-z: rows go down, y goes up.
  const ray = [(2 * aspect) / (width * f), -2 / (height * f), -aspect / f, 1 / f];
  const block = new ArrayBuffer(176);
  const floats = [...toView, ...projection, ...ray, dot(right, up), dot(over, up), dot(back, up), 0, near, far];
  new Float32Array(block).set(floats);
  new Uint32Array(block).set([width, height], floats.length);
  return block;
}

const MARGIN = 1.02;

/** The whole scene, seen from the front, a little from above and beside. */
export function framingView(bounds: Bounds, up: Vec3, aspect: number, fov = 38): View {
  const centre = scaled(add(bounds[0], bounds[1]), 0.5);
  const view = turned({ eye: add(centre, [0, 0, 1]), target: centre, up, fov }, 25, 20, 1);
  const { right, over, back } = axesOf(view);
  const half = Math.tan((fov * Math.PI) / 360);
  const needed = corners(bounds).map((corner) => {
    const offset = subtract(corner, centre);
    const aside = Math.max(Math.abs(dot(offset, right)) / (half * aspect), Math.abs(dot(offset, over)) / half);
    return aside + dot(offset, back);
  });
  return { ...view, eye: add(centre, scaled(back, Math.max(MARGIN * Math.max(...needed), 1e-6))) };
}

/**
 * A view turned about its target.
 *
 * @param aside Degrees to the right.
 * @param over Degrees upwards; the eye stays short of the poles.
 * @param away Factor of the distance.
 */
export function turned(view: View, aside: number, over: number, away: number): View {
  const offset = subtract(view.eye, view.target);
  const distance = length(offset);
  const up = unit(view.up);
  const rise = Math.asin(Math.min(Math.max(dot(offset, up) / distance, -1), 1));
  const flat = unit(subtract(offset, scaled(up, dot(offset, up))));
  const azimuth = (aside * Math.PI) / 180;
  const ahead = add(scaled(flat, Math.cos(azimuth)), scaled(cross(up, flat), Math.sin(azimuth)));
  const limit = (85 * Math.PI) / 180;
  const elevation = Math.min(Math.max(rise + (over * Math.PI) / 180, -limit), limit);
  const back = add(scaled(ahead, Math.cos(elevation)), scaled(up, Math.sin(elevation)));
  return { ...view, eye: add(view.target, scaled(back, distance * away)) };
}

/** A view moved sideways and upwards, by shares of the picture's height. */
export function moved(view: View, aside: number, over: number): View {
  const axes = axesOf(view);
  const size = 2 * Math.tan((view.fov * Math.PI) / 360) * length(subtract(view.eye, view.target));
  const by = add(scaled(axes.right, aside * size), scaled(axes.over, over * size));
  return { ...view, eye: add(view.eye, by), target: add(view.target, by) };
}
