// The page Compare: two pictures in one frame. The form holds the state, and the address is what the form would send,
// so that every link can be shared; without this file the form's button does the same.
"use strict";

const SETTLE_MS = 90; // how long a pointer rests before its pixel is asked for
const REMEMBERED = 300; // pixels
const DRAG_PIXELS = 4; // a press that moves less is a click
const NO_PICTURE = "A picture could not be loaded: it was removed, or the service is busy or cannot be reached.";
const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

function compare(form, stage) {
  const sheet = stage.querySelector(".sheet");
  const box = stage.parentElement;
  const inspector = document.getElementById("inspector");
  const size = [Number(stage.dataset.width), Number(stage.dataset.height)];
  const field = (name) => form.elements[name];
  const at = (id) => document.getElementById(id);
  const query = () => new URLSearchParams(new FormData(form));
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  box.classList.add("live");
  sheet.style.aspectRatio = `${size[0]} / ${size[1]}`;

  // What went wrong and still is: with a picture, with the pixel.

  const faults = new Map();
  function tell(what, text) {
    if (text) faults.set(what, text);
    else faults.delete(what);
    trouble.textContent = [...faults.values()].join(" ");
    trouble.hidden = faults.size === 0;
  }

  // Pictures, loaded when their mode is first shown.

  const images = new Map();
  for (const [key, id] of [["a", "picture-a"], ["b", "picture-b"], ["map", "picture-map"]]) {
    const image = at(id) ?? Object.assign(new Image(), { id });
    const failed = image.complete && image.naturalWidth === 0; // before this file was there to hear of it
    image.dataset.source = failed ? "" : (image.getAttribute("src") ?? "");
    image.addEventListener("error", () => {
      image.dataset.source = ""; // the next time that it is shown it is asked for again
      tell("picture", `${NO_PICTURE} The button Show asks for it again.`);
    });
    images.set(key, image);
    sheet.append(image);
  }
  const cross = Object.assign(document.createElement("div"), { className: "cross", hidden: true });
  sheet.append(cross);
  const divider = Object.assign(document.createElement("div"), { className: "divider", hidden: true });
  box.append(divider);

  function address(show, side) {
    const asked = new URLSearchParams({ scene: field("scene").value, view: field("view").value });
    asked.set("a", field(side).value);
    if (show === "difference" || show === "flip") asked.set("b", field("b").value);
    asked.set("show", show);
    if (show === "difference") asked.set("amplify", field("amplify").value);
    if (show === "k") asked.set("top", stage.dataset.top);
    return `/compare/picture.png?${asked}`;
  }

  function load(key, show, side, text) {
    const source = address(show, side);
    const image = images.get(key);
    if (image.dataset.source !== source) {
      image.dataset.source = source;
      image.src = source;
      image.alt = text;
    }
  }

  // What is shown.

  const mode = () => field("mode").value;
  let other = false; // Blink: whether B is in front

  function apply() {
    tell("picture", "");
    const chosen = mode();
    const double = chosen === "slider" || chosen === "blink";
    if (double) {
      for (const side of ["a", "b"]) load(side, "picture", side, `${side.toUpperCase()}: ${title(side)}`);
    } else if (chosen.startsWith("k-")) {
      load("map", "k", chosen.slice(2), `k of ${chosen.slice(2).toUpperCase()}: ${title(chosen.slice(2))}`);
    } else {
      load("map", chosen, "a", `${chosen} of ${title("a")} and ${title("b")}`);
    }
    at("difference-in-full").href = address("difference", "a");
    stage.dataset.mode = chosen;
    for (const name of ["slider", "blink", "difference", "flip", "k"]) {
      for (const control of document.querySelectorAll(`.for-${name}`)) control.hidden = !chosen.startsWith(name);
    }
    images.get("map").classList.toggle("on", !double);
    images.get("a").classList.toggle("on", double && !(chosen === "blink" && other));
    images.get("b").classList.toggle("on", chosen === "slider" || (chosen === "blink" && other));
    at("shown").textContent = other ? "B is shown" : "A is shown";
    divider.hidden = chosen !== "slider";
    enlarge();
    split();
    mark();
    beat();
  }

  const title = (side) => field(side).selectedOptions[0].textContent;

  // What is seen of the pictures, which may be narrower than their frame.
  const across = () => Math.min(stage.clientWidth, sheet.clientWidth);

  function split() {
    const left = (Number(field("split").value) / 100) * across();
    images.get("b").style.clipPath = mode() === "slider" ? `inset(0 0 0 ${stage.scrollLeft + left}px)` : "";
    divider.style.left = `${left}px`;
  }

  function enlarge() {
    const zoom = field("zoom").value;
    sheet.style.width = zoom === "fit" ? "100%" : `${size[0] * Number(zoom)}px`;
  }

  // Zooms about a point of the frame, so that what is looked at stays where it is.
  function zoomTo(value, left = stage.clientWidth / 2, top = stage.clientHeight / 2) {
    const before = sheet.getBoundingClientRect();
    const frame = stage.getBoundingClientRect();
    const [u, v] = [(frame.left + left - before.left) / before.width, (frame.top + top - before.top) / before.height];
    field("zoom").value = value;
    enlarge();
    const after = sheet.getBoundingClientRect();
    stage.scrollLeft = u * after.width - left;
    stage.scrollTop = v * after.height - top;
    split();
  }

  function step(by) {
    const all = [...field("zoom").options].map((option) => option.value);
    const next = all[all.indexOf(field("zoom").value) + by];
    if (next) {
      zoomTo(next);
      keep();
    }
  }

  // Blink: only while it is looked at, and never by itself where less motion is asked for.

  let timer = 0;
  let playing = !still.matches;
  function beat() {
    clearInterval(timer);
    timer = 0;
    at("play").setAttribute("aria-pressed", String(playing));
    if (mode() === "blink" && playing && !document.hidden) {
      timer = setInterval(swap, 1000 / Number(at("rate").value));
    }
  }
  function swap() {
    other = !other;
    images.get("a").classList.toggle("on", !other);
    images.get("b").classList.toggle("on", other);
    at("shown").textContent = other ? "B is shown" : "A is shown";
  }
  at("play").addEventListener("click", () => {
    playing = !playing;
    beat();
  });
  at("swap").addEventListener("click", () => {
    playing = false;
    beat();
    swap();
  });
  at("rate").addEventListener("change", beat);
  document.addEventListener("visibilitychange", beat);

  // The pixel.

  const held = () => (field("x").value && field("y").value ? [Number(field("x").value), Number(field("y").value)] : null);

  function mark() {
    const pixel = held();
    cross.hidden = !pixel;
    if (!pixel) return;
    cross.style.left = `${(100 * pixel[0]) / size[0]}%`;
    cross.style.top = `${(100 * pixel[1]) / size[1]}%`;
    cross.style.width = `${100 / size[0]}%`;
    cross.style.height = `${100 / size[1]}%`;
  }

  function reveal() {
    const pixel = held();
    if (!pixel) return;
    const [x, y] = [((pixel[0] + 0.5) / size[0]) * sheet.clientWidth, ((pixel[1] + 0.5) / size[1]) * sheet.clientHeight];
    const near = 24;
    if (x < stage.scrollLeft + near || x > stage.scrollLeft + stage.clientWidth - near) {
      stage.scrollLeft = x - stage.clientWidth / 2;
    }
    if (y < stage.scrollTop + near || y > stage.scrollTop + stage.clientHeight - near) {
      stage.scrollTop = y - stage.clientHeight / 2;
    }
  }

  function hold(pixel, replace = false) {
    const inside = pixel && pixel.map((value, i) => Math.min(Math.max(value, 0), size[i] - 1));
    field("x").value = inside ? inside[0] : "";
    field("y").value = inside ? inside[1] : "";
    mark();
    keep(replace);
    if (inside) {
      reveal();
      inspect(inside, true);
    }
  }

  const seen = new Map();
  let due = 0;
  let running = null;
  function inspect(pixel, aloud) {
    clearTimeout(due);
    due = setTimeout(() => look(pixel, aloud), SETTLE_MS);
  }

  async function look(pixel, aloud) {
    const asked = new URLSearchParams({ x: pixel[0], y: pixel[1] });
    for (const name of ["scene", "view", "a", "b"]) asked.set(name, field(name).value);
    const address = `/compare/pixel?${asked}`;
    running?.abort();
    running = new AbortController();
    try {
      const text = seen.get(address) ?? (await fetched(address, running.signal));
      seen.delete(address);
      seen.set(address, text);
      if (seen.size > REMEMBERED) seen.delete(seen.keys().next().value);
      inspector.innerHTML = text;
      tell("pixel", "");
      if (aloud) said.textContent = inspector.querySelector("[data-say]")?.dataset.say ?? "";
    } catch (error) {
      if (error.name === "AbortError") return;
      inspector.firstElementChild?.classList.add("old");
      tell("pixel", `The pixel could not be read: ${error.message}. What is shown is of another one.`);
    }
  }

  async function fetched(address, signal) {
    let answer;
    try {
      answer = await fetch(address, { signal, headers: { "HX-Request": "true" } });
    } catch (error) {
      throw error.name === "AbortError" ? error : new Error("the service cannot be reached");
    }
    if (answer.status === 401) location.reload(); // the session has ended: the server asks to sign in
    if (!answer.ok) throw new Error(`the service answered ${answer.status}`);
    return answer.text();
  }

  // The address.

  function keep(replace = false) {
    const address = `/compare?${query()}`;
    if (address === location.pathname + location.search) return;
    history[replace ? "replaceState" : "pushState"](null, "", address);
  }

  addEventListener("popstate", () => {
    const asked = new URLSearchParams(location.search);
    const same = ["scene", "view", "a", "b"].every((name) => asked.get(name) === field(name).value);
    if (!same) {
      location.reload();
      return;
    }
    for (const name of ["mode", "zoom", "amplify", "split", "x", "y"]) field(name).value = asked.get(name) ?? "";
    apply();
    reveal();
    if (held()) inspect(held(), false);
  });

  // The form.

  for (const radio of form.querySelectorAll("[name=mode]")) {
    radio.addEventListener("change", () => {
      apply();
      keep();
    });
  }
  field("amplify").addEventListener("change", () => {
    apply();
    keep();
  });
  field("zoom").addEventListener("change", () => {
    apply();
    reveal();
    keep();
  });
  const typed = () => {
    const pixel = held();
    hold(pixel && pixel.every(Number.isInteger) ? pixel : null);
  };
  for (const name of ["x", "y"]) field(name).addEventListener("change", typed);
  form.addEventListener("submit", (event) => {
    if (event.submitter || document.activeElement?.closest("input.short")) {
      event.preventDefault();
      apply();
      typed();
    }
  });
  field("split").addEventListener("input", split);
  field("split").addEventListener("change", () => keep(true));

  // Pointer and keys.

  const pixelUnder = (event) => {
    const place = sheet.getBoundingClientRect();
    const [x, y] = [(event.clientX - place.left) / place.width, (event.clientY - place.top) / place.height];
    return x >= 0 && x < 1 && y >= 0 && y < 1 ? [Math.floor(x * size[0]), Math.floor(y * size[1])] : null;
  };
  let press = null;
  stage.addEventListener("pointerdown", (event) => {
    if (event.button === 0) press = { x: event.clientX, y: event.clientY, left: stage.scrollLeft, top: stage.scrollTop };
  });
  addEventListener("pointermove", (event) => {
    if (!press || event.pointerType === "touch") return; // a finger scrolls by itself
    const [dx, dy] = [event.clientX - press.x, event.clientY - press.y];
    press.moved ||= Math.hypot(dx, dy) > DRAG_PIXELS;
    if (!press.moved) return;
    box.classList.add("panning");
    stage.scrollTo(press.left - dx, press.top - dy);
  });
  for (const kind of ["pointerup", "pointercancel"]) {
    addEventListener(kind, (event) => {
      if (press && !press.moved && kind === "pointerup" && stage.contains(event.target)) {
        const pixel = pixelUnder(event);
        if (pixel) hold(pixel);
      }
      press = null;
      box.classList.remove("panning");
    });
  }
  stage.addEventListener("pointermove", (event) => {
    const pixel = pixelUnder(event);
    if (pixel && !press && !held() && event.pointerType !== "touch") inspect(pixel, false);
  });
  stage.addEventListener("scroll", split);
  addEventListener("resize", split);
  stage.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const by = STEPS[event.key];
    if (by) {
      const from = held() ?? size.map((value) => Math.floor(value / 2));
      const far = event.shiftKey ? 10 : 1;
      hold(held() ? [from[0] + far * by[0], from[1] + far * by[1]] : from, Boolean(held()));
    } else if (event.key === "+" || event.key === "=") step(1);
    else if (event.key === "-") step(-1);
    else if (event.key === " ") {
      if (mode() === "blink") at("swap").click();
      else if (mode() === "slider") {
        field("split").value = Number(field("split").value) < 50 ? 100 : 0;
        split();
        keep(true);
      }
    } else if (event.key === "Escape") hold(null);
    else return;
    event.preventDefault();
  });
  divider.addEventListener("pointerdown", (event) => {
    divider.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  divider.addEventListener("pointermove", (event) => {
    if (!divider.hasPointerCapture(event.pointerId)) return;
    const frame = stage.getBoundingClientRect();
    field("split").value = (100 * (event.clientX - frame.left)) / across();
    split();
  });
  divider.addEventListener("lostpointercapture", () => keep(true));

  apply();
  keep(true);
  reveal();
}

// Other pictures are another page; what was in focus stays so.
const FOCUS = "compare-focus";
const choice = document.getElementById("choice");
if (choice) {
  for (const select of choice.querySelectorAll("[data-reload]")) {
    select.addEventListener("change", () => {
      sessionStorage.setItem(FOCUS, select.id);
      // What is compared now need not be there on another scene or view.
      if (select.id === "scene" || select.id === "view") choice.elements.near.disabled = false;
      choice.requestSubmit();
    });
  }
  document.getElementById(sessionStorage.getItem(FOCUS) ?? "")?.focus();
  sessionStorage.removeItem(FOCUS);
  const stage = document.getElementById("stage");
  if (stage) compare(choice, stage);
}
