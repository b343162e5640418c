// The page round an example: a canvas that is drawn when something has changed, what is waited for, what is wrong, and
// hands: a pointer, fingers, keys.

import { Trouble } from "@diaphane/core";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { type Node, type PerspectiveCamera, RenderPipeline, Spherical, Vector3, WebGPURenderer } from "three/webgpu";

/** What a page shows. */
export interface Example {
  readonly camera: PerspectiveCamera;
  /** What the camera turns round; the origin unless told. */
  readonly target?: Vector3;
  /** The picture, for a renderer; asked for again where a device was lost. */
  readonly output: () => Node;
}

const STEP = Math.PI / 24;
const NEARER = 0.9;
const LOST = "The graphics device was lost: the driver was reset, or another page used up its memory.";
const NONE = new Trouble(
  "This browser has neither WebGPU nor WebGL 2.",
  "Use a current Chrome, Edge, Firefox or Safari, and see that graphics acceleration is on in its settings.",
);
const PLAIN =
  "This browser has no WebGPU here, so that WebGL 2 draws, with depth bins alone: budgets need WebGPU, which a current " +
  "Chrome, Edge or Safari has on most machines.";

/** An element of the page. */
export function at<E extends HTMLElement>(id: string): E {
  return document.getElementById(id) as E;
}

/** Says what people wait for; empty: nothing. */
export function wait(text: string): void {
  at("status").textContent = text;
}

/** Says what is wrong, and offers to begin anew. */
function say(error: unknown, again?: () => void): void {
  const place = at("trouble");
  if (!(error instanceof Trouble)) console.error(error);
  place.textContent = error instanceof Trouble ? error.message : "Something went wrong; the browser's console has the details.";
  if (again) {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: "Draw again" });
    button.addEventListener("click", () => {
      place.hidden = true;
      again();
    });
    place.append(" ", button);
  }
  place.hidden = false;
}

/** What was said stands on the screen. */
const shown = (): Promise<void> => new Promise((done) => requestAnimationFrame(() => setTimeout(done)));

export class Frame {
  #renderer: WebGPURenderer | null = null;
  #pipeline: RenderPipeline | null = null;
  #controls: OrbitControls | null = null;
  #isWanted = false;
  #isDrawing = false;
  #hasDrawn = false;

  private constructor(private readonly example: Example) {}

  /**
   * Opens the page.
   *
   * @param make What it shows; it may fetch.
   * @param ready Is told once it can draw.
   * @param waiting What is said until then.
   */
  static async open(
    make: () => Example | Promise<Example>,
    ready: (frame: Frame) => void = () => undefined,
    waiting = "The scene is being made.",
  ): Promise<void> {
    try {
      wait(waiting);
      await shown();
      const frame = new Frame(await make());
      frame.#listen();
      await frame.#begin();
      ready(frame);
    } catch (error) {
      wait("");
      say(error);
    }
  }

  /** Draws soon; what is asked for while a picture is drawn is drawn once, after it. */
  redraw(): void {
    this.#isWanted = true;
    if (!this.#isDrawing) void this.#draw();
  }

  /** Does something that takes a while, then draws. */
  async after(waiting: string, work: () => Promise<void>): Promise<void> {
    wait(waiting);
    try {
      await work();
    } catch (error) {
      say(error);
    }
    wait("");
    this.redraw();
  }

  /** Of WebGPU; undefined: WebGL 2 draws. */
  get #device(): GPUDevice | undefined {
    return (this.#renderer?.backend as { device?: GPUDevice } | undefined)?.device;
  }

  async #begin(): Promise<void> {
    const renderer = new WebGPURenderer({ antialias: false });
    try {
      await renderer.init();
    } catch {
      throw NONE;
    }
    this.#renderer = renderer;
    const device = this.#device;
    at("note").textContent = device ? "" : PLAIN;
    const lost = (): void => this.#lost(renderer);
    renderer.onDeviceLost = lost;
    void device?.lost.then(lost);
    this.#pipeline = new RenderPipeline(renderer, this.example.output());
    this.#held(renderer.domElement);
    this.#sized();
  }

  /** The canvas in its place, with its hands. */
  #held(canvas: HTMLCanvasElement): void {
    canvas.setAttribute("aria-hidden", "true");
    at("stage").prepend(canvas);
    this.#controls = new OrbitControls(this.example.camera, canvas);
    this.#controls.target.copy(this.example.target ?? new Vector3());
    this.#controls.saveState();
    this.#controls.update();
    this.#controls.addEventListener("change", () => this.redraw());
  }

  #lost(renderer: WebGPURenderer): void {
    if (renderer !== this.#renderer) return;
    this.#controls?.dispose();
    renderer.domElement.remove();
    this.#renderer = this.#pipeline = this.#controls = null;
    wait("");
    const again = (): void => void this.#begin().catch((error: unknown) => say(error));
    say(new Trouble(LOST, "Nothing else was."), again);
  }

  #listen(): void {
    new ResizeObserver(() => this.#sized()).observe(at("stage"));
    at("stage").addEventListener("keydown", (event) => this.#key(event));
  }

  #sized(): void {
    const { clientWidth, clientHeight } = at("stage");
    if (!this.#renderer || !clientWidth) return;
    this.#renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.#renderer.setSize(clientWidth, clientHeight);
    this.example.camera.aspect = clientWidth / clientHeight;
    this.example.camera.updateProjectionMatrix();
    this.redraw();
  }

  #key(event: KeyboardEvent): void {
    const turns: Readonly<Record<string, readonly [number, number, number]>> = {
      ArrowLeft: [-STEP, 0, 1],
      ArrowRight: [STEP, 0, 1],
      ArrowUp: [0, -STEP, 1],
      ArrowDown: [0, STEP, 1],
      "+": [0, 0, NEARER],
      "=": [0, 0, NEARER],
      "-": [0, 0, 1 / NEARER],
    };
    const controls = this.#controls;
    const turn = turns[event.key];
    if (!controls || event.ctrlKey || event.metaKey || event.altKey || !(turn || event.key === "0")) return;
    event.preventDefault();
    if (!turn) return controls.reset();
    const { position } = this.example.camera;
    const place = new Spherical().setFromVector3(position.clone().sub(controls.target));
    place.theta += turn[0];
    place.phi = Math.min(Math.max(place.phi + turn[1], 0.05), Math.PI - 0.05);
    place.radius *= turn[2];
    position.setFromSpherical(place).add(controls.target);
    controls.update();
  }

  async #draw(): Promise<void> {
    this.#isDrawing = true;
    while (this.#isWanted && this.#renderer) {
      this.#isWanted = false;
      const late = setTimeout(() => wait("The picture is being drawn."), 250);
      if (!this.#hasDrawn) {
        wait("The shaders are being compiled.");
        await shown();
      }
      try {
        this.#pipeline?.render();
        await this.#device?.queue.onSubmittedWorkDone();
        this.#hasDrawn = true;
      } catch (error) {
        if (this.#renderer) say(error);
      }
      clearTimeout(late);
      await shown();
      if (this.#renderer) wait("");
    }
    this.#isDrawing = false;
  }
}
