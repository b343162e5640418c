// The page's elements, and what is written into them. Text only: nothing that a server or a file says becomes markup.

import { psnr, Trouble } from "@diaphane/core";
import type { Figures, Report } from "./stage";

/** An element of the page. */
export function at<E extends HTMLElement>(id: string): E {
  return document.getElementById(id) as E;
}

/** What something can be wrong with. */
export type Matter = "device" | "scene" | "model" | "picture";

const troubles = new Map<Matter, string>();

/** Says what is wrong with a matter; null: nothing any more. */
export function say(matter: Matter, error: unknown): void {
  if (error === null) {
    if (!troubles.delete(matter)) return;
  } else if (error instanceof Trouble) troubles.set(matter, error.message);
  else {
    troubles.set(matter, "Something went wrong. Load the page again; the browser's console has the details.");
    console.error(error);
  }
  const place = at("trouble");
  place.textContent = [...new Set(troubles.values())].join("\n");
  place.hidden = troubles.size === 0;
}

const waits = new Map<Matter, string>();

/** Says what people wait for in a matter; null: for nothing any more. */
export function wait(matter: Matter, text: string | null): void {
  if (text === null) waits.delete(matter);
  else waits.set(matter, text);
  const said = [...waits.values()].join(" ");
  if (at("status").textContent !== said) at("status").textContent = said;
}

const turns: Partial<Record<Matter, number>> = {};

/**
 * Does something that takes a while, says so, and says what went wrong.
 *
 * @param work Is told whether it is still wanted: whoever asks again has changed their mind.
 */
export async function busy(matter: Matter, text: string, work: (isWanted: () => boolean) => Promise<void>): Promise<void> {
  const turn = (turns[matter] ?? 0) + 1;
  turns[matter] = turn;
  const isWanted = (): boolean => turns[matter] === turn;
  wait(matter, text);
  try {
    await work(isWanted);
    if (isWanted()) say(matter, null);
  } catch (error) {
    if (isWanted()) say(matter, error);
  }
  if (isWanted()) wait(matter, null);
}

/** Makes the options of a choice. */
export function fill(select: HTMLSelectElement, options: readonly (readonly [value: string, text: string])[]): void {
  select.replaceChildren(...options.map(([value, text]) => new Option(text, value)));
}

/** Shows nothing of what was drawn before. */
export function clear(): void {
  at("figures").replaceChildren();
  at("facts").textContent = "";
}

/** Shows what was drawn. */
export function show(report: Report): void {
  const { counted, left, right, width, height, bytes } = report;
  at("figures").replaceChildren(row("left", left), row("right", right));
  const deep = counted.occupied ? (counted.fragments / counted.occupied).toFixed(1) : "0";
  at("facts").textContent =
    `${width} × ${height} pixels, ${number(counted.fragments)} transparent fragments in ${number(counted.occupied)} ` +
    `pixels, ${deep} each; ${(bytes / 2 ** 20).toFixed(1)} MiB of buffers.`;
}

function row(side: string, figures: Figures): HTMLTableRowElement {
  const line = document.createElement("tr");
  const head = document.createElement("th");
  head.scope = "row";
  head.textContent = `${side}: ${figures.technique}`;
  line.append(head);
  const { error, slots, milliseconds } = figures;
  const known = (text: (error: number) => string): string =>
    error === null ? "…" : Number.isNaN(error) ? "–" : text(error);
  const texts = [
    known((each) => (1e5 * each).toFixed(3)),
    known((each) => (each === 0 ? "exact" : psnr(each).toFixed(2))),
    slots ? number(slots) : "–",
    milliseconds.toFixed(1),
  ];
  for (const text of texts) line.insertCell().textContent = text;
  return line;
}

const number = (count: number): string => count.toLocaleString("en");
