// Parts of pages that change, values of charts, and what went wrong. Everything works without this file, but by
// loading the page again.
"use strict";

const said = document.getElementById("said");
const trouble = document.getElementById("trouble");

// A part that comes anew is morphed: what is the same stays, and with it the focus, what is selected, and how far a
// table is scrolled; ids tell rows apart. What a watched box has and a fresh one lacks is this file's (`reach`).
Idiomorph.defaults.callbacks.beforeAttributeUpdated = (name, box, change) =>
  change === "update" || box.dataset.watched === undefined;

// A stream tells that something has changed; htmx then fetches that part of the page anew, twice a second at most.
// A page that is not looked at gives its connection back: a browser has only a few.
function follow(box) {
  let source = null;
  let last = "";
  let due = 0;
  let again = 0;
  const part = box.firstElementChild;
  const changed = (event) => {
    last = event.lastEventId || last;
    due ||= setTimeout(() => {
      due = 0;
      htmx.trigger(box, "refresh");
    }, 500);
  };
  const open = () => {
    const url = new URL(box.dataset.stream, location.href);
    if (last) url.searchParams.set("after", last);
    source = new EventSource(url);
    for (const kind of ["change", "state", "stage", "task", "log"]) source.addEventListener(kind, changed);
    // Without a stream the page asks by itself: so it goes along, or says why it cannot. A browser gives up on a stream
    // that was refused: for good if all has been told, else only for now.
    source.addEventListener("error", (event) => {
      if (part.dataset.live === undefined) return;
      changed(event);
      if (source.readyState === EventSource.CLOSED) again = setTimeout(open, 5000);
    });
    source.addEventListener("open", (event) => {
      if (!trouble.hidden) changed(event);
    });
  };
  document.addEventListener("visibilitychange", () => {
    clearTimeout(again);
    source?.close();
    if (!document.hidden) open();
  });
  if (!document.hidden) open();
}

document.querySelectorAll("[data-stream]").forEach(follow);

// What a screen reader is told: one sentence, and only when it differs.
function say(part) {
  const sentence = part?.dataset?.say;
  if (sentence && sentence !== said.dataset.last) {
    if (said.dataset.last) said.textContent = sentence;
    said.dataset.last = sentence;
  }
}
document.querySelectorAll("[data-say]").forEach(say);

document.addEventListener("htmx:afterSwap", (event) => {
  say(document.getElementById(event.detail.target.id));
  trouble.hidden = true;
});
for (const kind of ["htmx:responseError", "htmx:sendError"]) {
  document.addEventListener(kind, (event) => {
    const status = event.detail.xhr?.status;
    trouble.textContent = status
      ? `This page could not be brought up to date: the service answered ${status}. What is shown may be old.`
      : "This page could not be brought up to date: the service cannot be reached. What is shown may be old.";
    trouble.hidden = false;
  });
}

// The value of the mark in a chart that is pointed at or has the focus; its <title> has it for screen readers.
const tip = document.createElement("div");
tip.className = "tip";
tip.hidden = true;
document.body.append(tip);

function show(event) {
  const mark = event.target.closest?.(".mark");
  const title = mark?.querySelector("title");
  tip.hidden = !title;
  if (!title) return;
  tip.textContent = title.textContent;
  const place = mark.getBoundingClientRect();
  const left = Math.min(place.right + 8, document.documentElement.clientWidth - tip.offsetWidth - 8);
  tip.style.left = `${Math.max(8, left) + scrollX}px`;
  tip.style.top = `${Math.max(place.top - tip.offsetHeight - 6, 4) + scrollY}px`;
}
for (const kind of ["pointerover", "focusin"]) document.addEventListener(kind, show);
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape") tip.hidden = true;
});

// A chart is one stop of the keyboard, however many values it has; arrows go from one to the next.
function reachMarks() {
  for (const chart of document.querySelectorAll('svg.chart[role="img"]')) {
    chart.setAttribute("role", "group"); // as an image it would hide its marks
    chart.setAttribute("aria-description", "Arrow keys go from value to value.");
    chart.querySelectorAll(".mark").forEach((mark, i) => {
      mark.setAttribute("tabindex", i ? "-1" : "0");
      mark.setAttribute("role", "img");
      mark.setAttribute("aria-label", mark.querySelector("title").textContent);
    });
  }
}
document.addEventListener("keydown", (event) => {
  const mark = event.target.closest?.("svg.chart .mark");
  if (!mark || event.ctrlKey || event.metaKey || event.altKey) return;
  const marks = [...mark.closest("svg").querySelectorAll(".mark")];
  const [at, end] = [marks.indexOf(mark), marks.length - 1];
  const to = { ArrowRight: at + 1, ArrowDown: at + 1, ArrowLeft: at - 1, ArrowUp: at - 1, Home: 0, End: end }[event.key];
  if (to === undefined) return;
  event.preventDefault();
  const next = marks[Math.min(Math.max(to, 0), end)];
  mark.setAttribute("tabindex", "-1");
  next.setAttribute("tabindex", "0");
  next.focus();
});

// What scrolls is a stop of the keyboard, if there is none in it; what does not scroll is none.
const STOPS = "a[href], button, input, select, textarea, summary, [tabindex]";
const scrollers = new ResizeObserver((entries) => entries.forEach((entry) => reach(entry.target)));
function reach(box) {
  const scrolls = box.scrollWidth > box.clientWidth + 1 || box.scrollHeight > box.clientHeight + 1;
  if (scrolls && !box.querySelector(STOPS)) {
    const before = (heading) => heading.compareDocumentPosition(box) & Node.DOCUMENT_POSITION_FOLLOWING;
    const heading = [...document.querySelectorAll("h1, h2, h3")].filter(before).at(-1);
    box.tabIndex = 0;
    box.setAttribute("role", "region");
    box.setAttribute("aria-label", (box.querySelector("caption") ?? heading)?.textContent.trim() ?? "");
  } else {
    for (const name of ["tabindex", "role", "aria-label"]) box.removeAttribute(name);
  }
}
function watchScrollers() {
  for (const box of document.querySelectorAll(".scroll, .log, pre")) {
    if (box.dataset.watched !== undefined || box.hasAttribute("tabindex")) continue;
    box.dataset.watched = "";
    scrollers.observe(box);
  }
}
function reachAll() {
  watchScrollers();
  reachMarks();
}
new MutationObserver(reachAll).observe(document.getElementById("main"), { childList: true, subtree: true });
reachAll();
