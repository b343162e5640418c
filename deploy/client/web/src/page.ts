// The page's elements, and what is written into them. Text only: nothing that a server or a file says becomes markup.

import { psnr } from "./passes/screen";
import type { Figures, Report } from "./stage";
import { Trouble } from "./trouble";

/** An element of the page. */
export function at<E extends HTMLElement>(id: string): E {
  return document.getElementById(id) as E;
}

/** Says what is wrong; null: nothing any more. */
export function say(error: unknown): void {
  const place = at("trouble");
  place.hidden = error === null;
  if (error === null) place.textContent = "";
  else if (error instanceof Trouble) place.textContent = error.message;
  else {
    place.textContent = "Something went wrong. Load the page again; the browser's console has the details.";
    console.error(error);
  }
}

/** Makes the options of a choice. */
export function fill(select: HTMLSelectElement, options: readonly (readonly [value: string, text: string])[]): void {
  select.replaceChildren(...options.map(([value, text]) => new Option(text, value)));
}

/** Shows what was drawn. */
export function show(report: Report): void {
  const { counted, left, right, width, height } = report;
  at("figures").replaceChildren(row("left", left), row("right", right));
  const deep = counted.occupied ? (counted.fragments / counted.occupied).toFixed(1) : "0";
  at("facts").textContent =
    `${width} × ${height} pixels, ${number(counted.fragments)} transparent fragments in ${number(counted.occupied)} ` +
    `pixels, ${deep} each.`;
}

function row(side: string, figures: Figures): HTMLTableRowElement {
  const line = document.createElement("tr");
  const head = document.createElement("th");
  head.scope = "row";
  head.textContent = `${side}: ${figures.technique}`;
  line.append(head);
  const { error, slots, milliseconds } = figures;
  const decibels = error === null ? "…" : error === 0 ? "exact" : psnr(error).toFixed(2);
  const texts = [
    error === null ? "…" : (1e5 * error).toFixed(3),
    decibels,
    slots ? number(slots) : "–",
    milliseconds.toFixed(1),
  ];
  for (const text of texts) line.insertCell().textContent = text;
  return line;
}

const number = (count: number): string => count.toLocaleString("en");
