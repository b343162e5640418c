// Draws the charts of a page: Vega-Lite specifications that stand in it as data. Values are told where one points at a
// mark, and to those who go from mark to mark with the keyboard. Colours follow the page's theme.
"use strict";

(() => {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const own = document.currentScript;
  const views = new Map();
  let loaded = null;
  const marked = "g[class*='marks_marks'] > path";

  // A page of a service names where Vega is, and it is fetched with the first chart; a page by itself has it in it.
  function runtime() {
    const names = (own?.dataset.runtime ?? "").split(" ").filter(Boolean);
    const load = (address) =>
      new Promise((done, failed) => {
        const script = document.createElement("script");
        Object.assign(script, { src: address, onload: done, onerror: failed });
        document.head.append(script);
      });
    loaded ??= names.reduce((before, name) => before.then(() => load(name)), Promise.resolve());
    return loaded;
  }

  const tip = document.createElement("div");
  tip.className = "tip";
  tip.hidden = true;
  tip.setAttribute("aria-hidden", "true"); // a screen reader has the name of the mark
  document.body.append(tip);

  function tell(text, place) {
    tip.hidden = !text;
    if (!text) return;
    tip.textContent = text;
    const left = Math.min(place.right + 8, document.documentElement.clientWidth - tip.offsetWidth - 8);
    tip.style.left = `${Math.max(8, left) + scrollX}px`;
    tip.style.top = `${Math.max(place.top - tip.offsetHeight - 6, 4) + scrollY}px`;
  }

  function themed(box) {
    const text = box.querySelector('script[type="application/json"]').textContent;
    const found = JSON.parse(text);
    const colours = found.usermeta.dark;
    return dark.matches ? JSON.parse(text, (_, value) => (Object.hasOwn(colours, value) ? colours[value] : value)) : found;
  }

  async function draw(box) {
    views.set(box, null);
    await runtime();
    const spec = themed(box);
    // The page's own background shows, and its legend keeps to its width.
    spec.config.background = null;
    const runs = vega.parse(vegaLite.compile(spec).spec, null, { ast: true });
    views.get(box)?.finalize();
    const place = document.createElement("div");
    place.className = "drawn";
    box.querySelector(".drawn")?.remove();
    box.append(place);
    const view = new vega.View(runs, {
      renderer: "svg",
      container: place,
      hover: true,
      expr: vega.expressionInterpreter,
      tooltip: (_, event, __, value) => tell(value, event?.target.getBoundingClientRect()), // no event: the view ends
    });
    views.set(box, view);
    await view.runAsync();
    await view.resize().runAsync(); // the place is as wide as it will be, now that there is something in it
    reach(place);
    box.dataset.theme = dark.matches ? "dark" : "light";
  }

  // A chart is one stop of the keyboard, however many values it has; arrows go from one to the next.
  function reach(place) {
    const svg = place.querySelector("svg");
    svg.setAttribute("role", "group"); // as an image it would hide its marks
    svg.setAttribute("aria-label", place.parentElement.dataset.label);
    svg.setAttribute("aria-description", "Arrow keys go from value to value.");
    svg.querySelectorAll(marked).forEach((mark, i) => {
      mark.classList.add("mark");
      mark.setAttribute("tabindex", i ? "-1" : "0");
      mark.setAttribute("role", "img");
    });
  }


  document.addEventListener("focusin", (event) => {
    const mark = event.target.closest?.(".chart .mark");
    if (mark) tell(mark.getAttribute("aria-label"), mark.getBoundingClientRect());
    else tip.hidden = true;
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") tip.hidden = true;
    const mark = event.target.closest?.(".chart .mark");
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

  function drawAll() {
    for (const box of views.keys()) {
      if (!box.isConnected) {
        views.get(box)?.finalize();
        views.delete(box);
      }
    }
    for (const box of document.querySelectorAll(".chart")) if (!views.has(box)) draw(box);
  }
  dark.addEventListener("change", () => [...views.keys()].forEach(draw));
  new MutationObserver(drawAll).observe(document.querySelector("main") ?? document.body, { childList: true, subtree: true });
  drawAll();
})();
