// The demo: puts scene, model, techniques and controls together.

import shells from "../../../samples/shells.glb?url";
import shelf from "../../../samples/shelf.glb?url";
import {
  type Bundle,
  Gpu,
  type Memory,
  type Mode,
  Registry,
  selfTest,
  SignedOut,
  type Technique,
  TECHNIQUES,
  Trouble,
  type View,
} from "@diaphane/core";
import { readGlb } from "./gltf";
import { attach } from "./hands";
import { at, busy, clear, fill, say, show, wait } from "./page";
import { type Report, Stage } from "./stage";

const SAMPLES = { "glass shells": shells, "a shelf of bottles": shelf };
const NAMES: Readonly<Record<Technique, string>> = {
  binned: "binned: depth bins alone",
  "kbuffer-deep": "kbuffer-deep: predicted k",
  kbuffer: "kbuffer: fixed k",
  "weighted-blended": "weighted-blended",
  sbuffer: "sbuffer: exact",
};
const LEGENDS: Readonly<Record<Mode, string>> = {
  picture: "",
  count: "0, 1, 3, 7, … to 63 fragments and more, by doubling",
  error: "largest difference of red, green and blue: 0 to 32 of 255 and more",
};

const registry = new Registry(memory());
const select = (id: string): HTMLSelectElement => at<HTMLSelectElement>(id);

/** What is kept between visits; where the browser is told to keep nothing, between models. */
function memory(): Memory {
  try {
    return localStorage;
  } catch {
    const kept = new Map<string, string>();
    return {
      getItem: (name) => kept.get(name) ?? null,
      setItem: (name, value) => void kept.set(name, value),
    };
  }
}

async function start(): Promise<void> {
  const drawn = (report: Report): void => {
    say("picture", null);
    show(report);
  };
  const waits = (is: boolean): void => wait("picture", is ? "The picture is being drawn." : null);
  const failed = (error: unknown): void => {
    say("picture", error);
    clear();
  };
  const stage = new Stage(await Gpu.open(), at<HTMLCanvasElement>("canvas"), drawn, waits, failed);
  stage.gpu.device.addEventListener("uncapturederror", ({ error }) => {
    const remedy = "Make the window or the budget smaller, or open a smaller scene; then load the page again.";
    const isFull = error instanceof GPUOutOfMemoryError;
    say("device", isFull ? new Trouble("The graphics device has no memory left.", remedy) : error);
  });
  fill(
    select("scene"),
    Object.keys(SAMPLES).map((name) => [name, name]),
  );
  for (const side of ["left", "right"] as const) choose(stage, side, stage.wanted[side]);
  listen(stage);
  attach(at("stage"), stage, (by) => setSplit(stage, stage.wanted.split + by));
  // For whoever wants numbers: a picture of the open scene at the canvas's size.
  Object.assign(globalThis, {
    diaphane: { picture: (view: View, technique: Technique, factor: number) => stage.picture(view, technique, factor) },
  });
  await Promise.all([openSample(stage), offerModels(stage)]);
}

function listen(stage: Stage): void {
  const changed = (id: string, act: () => unknown): void =>
    at(id).addEventListener(id === "budget" || id === "split" ? "input" : "change", () => void act());
  changed("scene", () => (select("scene").value ? openSample(stage) : openFile(stage, own)));
  const file = at<HTMLInputElement>("file");
  changed("file", () => openFile(stage, file.files?.[0]));
  file.addEventListener("click", () => (file.value = "")); // else the same file, chosen again, is no change
  changed("model", () => loadModel(stage));
  changed("mode", () => setMode(stage));
  changed("split", () => setSplit(stage, at<HTMLInputElement>("split").valueAsNumber / 100));
  changed("budget", () => setBudget(stage));
  for (const side of ["left", "right"] as const)
    changed(side, () => choose(stage, side, select(side).value as Technique));
  at("controls").addEventListener("submit", (event) => event.preventDefault());
  at("forget").addEventListener("click", () => {
    const [name] = chosenModel();
    if (name) registry.forget(name);
    void loadModel(stage);
  });
  // Anywhere on the page: beside the picture a browser would leave the page for the file.
  const over = (event: DragEvent, is: boolean): void => {
    event.preventDefault();
    at("stage").classList.toggle("over", is);
  };
  addEventListener("dragover", (event) => over(event, event.dataTransfer?.types.includes("Files") ?? false));
  addEventListener("dragleave", (event) => over(event, false));
  addEventListener("drop", (event) => {
    over(event, false);
    void openFile(stage, event.dataTransfer?.files[0]);
  });
  new ResizeObserver(() => stage.draw()).observe(stage.canvas);
  setBudget(stage);
}

const openSample = (stage: Stage): Promise<void> =>
  busy("scene", "The scene is loading.", async (isWanted) => {
    const name = select("scene").value as keyof typeof SAMPLES;
    const scene = await readGlb(name, await sample(SAMPLES[name]));
    if (isWanted()) await stage.open(scene);
  });

async function sample(address: string): Promise<Blob> {
  try {
    const answer = await fetch(address);
    if (answer.ok) return await answer.blob();
  } catch {
    // The network: the same to do.
  }
  throw new Trouble("The sample cannot be loaded.", "Check the connection, then load the page again.");
}

/** The last one that was opened; among the scenes it has no name of its own. */
let own: File | undefined;

async function openFile(stage: Stage, file: File | undefined): Promise<void> {
  if (!file) return;
  await busy("scene", "The file is read.", async (isWanted) => {
    const scene = await readGlb(file.name, file);
    if (!isWanted()) return;
    await stage.open(scene);
    own = file;
    if (!Array.from(select("scene").options).some((option) => option.value === "")) {
      select("scene").prepend(new Option("", ""));
    }
    select("scene").options[0]!.text = file.name;
    select("scene").value = "";
  });
}

function choose(stage: Stage, side: "left" | "right", technique: Technique): void {
  const usable = TECHNIQUES.filter((each) => each !== "kbuffer-deep" || stage.bundle !== null);
  fill(
    select(side),
    usable.map((each) => [each, NAMES[each]]),
  );
  stage.wanted[side] = usable.includes(technique) ? technique : "binned";
  select(side).value = stage.wanted[side];
  at(`${side}-name`).textContent = stage.wanted[side];
  stage.draw();
}

function setMode(stage: Stage): void {
  const mode = select("mode").value as Mode;
  stage.wanted.mode = mode;
  at("legend").hidden = mode === "picture";
  at("ramp").className = mode;
  at("legend-text").textContent = LEGENDS[mode];
  if (mode === "error") stage.draw();
  else stage.present();
}

function setSplit(stage: Stage, split: number): void {
  stage.wanted.split = Math.min(Math.max(split, 0), 1);
  at<HTMLInputElement>("split").valueAsNumber = Math.round(100 * stage.wanted.split);
  stage.present();
}

function setBudget(stage: Stage): void {
  stage.wanted.factor = 2 ** at<HTMLInputElement>("budget").valueAsNumber;
  at("budget-value").textContent = `${stage.wanted.factor.toPrecision(3)} fragments per pixel`;
  stage.draw();
}

const chosenModel = (): string[] => select("model").value.split("@");

async function offerModels(stage: Stage): Promise<void> {
  const note = at("model-note");
  try {
    const choices = await registry.choices();
    if (choices.length === 0) {
      note.textContent = "There is no model yet: build one, then load this page again. The other techniques need none.";
      return;
    }
    const names = choices.map(({ name, selector, version }): [string, string] => {
      const text = selector === version ? `${name} ${version}` : `${name}@${selector} (${version})`;
      return [`${name}@${selector}`, text];
    });
    fill(select("model"), [["", "none"], ...names]);
    select("model").disabled = false;
    select("model").value = names[0]![0];
    await loadModel(stage);
  } catch (error) {
    note.textContent = error instanceof Error ? error.message : "";
    if (!(error instanceof SignedOut)) return;
    const link = document.createElement("a");
    link.href = "/sign-in?next=%2Fdemo";
    link.textContent = "Sign in";
    note.replaceChildren(link, " to render with a published model. The other techniques need none.");
  }
}

async function loadModel(stage: Stage): Promise<void> {
  const [name, selector] = chosenModel();
  const note = at("model-note");
  note.textContent = "";
  const use = (bundle: Bundle | null): void => {
    const isFirst = bundle !== null && stage.bundle === null;
    stage.bundle = bundle;
    choose(stage, "left", stage.wanted.left);
    choose(stage, "right", isFirst ? "kbuffer-deep" : stage.wanted.right);
  };
  // The last model is drawn with until this one is there, or refused.
  await busy("model", name ? "The model is fetched." : "", async (isWanted) => {
    try {
      const bundle = name && selector ? await registry.pull(name, selector) : null;
      if (bundle) await selfTest(stage.gpu, bundle);
      if (!isWanted()) return;
      use(bundle);
      if (!bundle) return;
      const signed = bundle.isSigned
        ? "signature and hashes are right"
        : "hashes are right; this browser cannot check the signature (it has no Ed25519), and trusts the server";
      note.textContent = `${name} ${bundle.version}: ${signed}; its self-test passes on this device.`;
    } catch (error) {
      if (isWanted()) use(null);
      throw error;
    }
  });
}

start().catch((error: unknown) => {
  say("device", error);
  at("status").textContent = "There is nothing to see without WebGPU.";
  for (const control of document.querySelectorAll<HTMLInputElement>("#controls input, #controls select")) {
    control.disabled = true;
  }
});
