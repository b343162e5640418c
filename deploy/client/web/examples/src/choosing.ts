// How a page lets people choose what a pass renders with.

import manifest from "../../../../../benchmarks/bundle/manifest.json?url";
import network from "../../../../../benchmarks/bundle/predict.wgsl?url";
import { type Bundle, shippedBundle, Trouble } from "@diaphane/core";
import type { DiaphanePassNode, Technique } from "@diaphane/three";
import { at, type Frame } from "./frame";

async function text(address: string): Promise<string> {
  const answer = await fetch(address).catch(() => null);
  if (!answer?.ok) throw new Trouble("The bundle could not be fetched.", "Choose the technique again.");
  return answer.text();
}

let fetched: Promise<Bundle> | null = null;

/** The bundle that comes with Diaphane; it was trained on none of these scenes. */
async function bundle(): Promise<Bundle> {
  fetched ??= Promise.all([text(manifest), text(network)]).then((files) => shippedBundle(...files));
  return fetched.catch((error: unknown) => {
    fetched = null;
    throw error;
  });
}

/** Joins a pass to the page's choices of a technique and a budget. */
export function choosing(frame: Frame, pass: DiaphanePassNode): void {
  const technique = at<HTMLSelectElement>("technique");
  const budget = at<HTMLInputElement>("budget");
  const changed = async (): Promise<void> => {
    const wanted = technique.value as Technique;
    budget.disabled = wanted === "binned";
    budget.step = wanted === "kbuffer-deep" ? "0.25" : "1";
    budget.min = budget.step;
    at("budget-value").textContent =
      wanted === "binned" ? "none" : `${budget.value} per pixel${wanted === "kbuffer-deep" ? " on average" : ""}`;
    if (wanted === "kbuffer-deep" && !pass.bundle)
      await frame.after("The bundle is being fetched.", async () => void (pass.bundle = await bundle()));
    [pass.technique, pass.budget] = [wanted, Number(budget.value)];
    frame.redraw();
  };
  for (const each of [technique, budget]) each.addEventListener("input", () => void changed());
  void changed();
}
