// Pointer, wheel and keys on the stage.

import { moved, turned } from "@diaphane/core";
import type { Stage } from "./stage";

const STEP = 6;
const NEARER = 0.88;

/** Lets people turn, move and leave what the stage shows; `split` moves the split by a share. */
export function attach(element: HTMLElement, stage: Stage, split: (by: number) => void): void {
  element.addEventListener("pointerdown", (event) => element.setPointerCapture(event.pointerId));
  element.addEventListener("pointermove", (event) => {
    if (!element.hasPointerCapture(event.pointerId) || !stage.view) return;
    const height = element.clientHeight;
    const [x, y] = [event.movementX / height, event.movementY / height];
    const aside = event.shiftKey || event.buttons === 2;
    stage.view = aside ? moved(stage.view, -x, y) : turned(stage.view, -180 * x, 180 * y, 1);
    stage.draw();
  });
  element.addEventListener("contextmenu", (event) => event.preventDefault());
  element.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      if (!stage.view) return;
      stage.view = turned(stage.view, 0, 0, Math.exp(Math.min(Math.max(event.deltaY, -200), 200) / 600));
      stage.draw();
    },
    { passive: false },
  );
  element.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !act(event.key, event.shiftKey)) return;
    event.preventDefault();
  });

  function act(key: string, shift: boolean): boolean {
    const { view } = stage;
    if (!view) return false;
    const arrows: Record<string, readonly [number, number]> = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, 1],
      ArrowDown: [0, -1],
    };
    const arrow = arrows[key];
    if (arrow) {
      stage.view = shift
        ? moved(view, 0.05 * arrow[0], 0.05 * arrow[1])
        : turned(view, STEP * arrow[0], STEP * arrow[1], 1);
    } else if (key === "+" || key === "=") stage.view = turned(view, 0, 0, NEARER);
    else if (key === "-") stage.view = turned(view, 0, 0, 1 / NEARER);
    else if (key === "[" || key === "]") {
      split(key === "[" ? -0.05 : 0.05);
      return true;
    } else if (key === "0") {
      stage.home();
      return true;
    } else return false;
    stage.draw();
    return true;
  }
}
