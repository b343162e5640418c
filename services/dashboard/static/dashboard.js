// Parts of pages that change, and what went wrong. Everything works without this file, but by
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
new MutationObserver(watchScrollers).observe(document.getElementById("main"), { childList: true, subtree: true });
watchScrollers();
