import source from "./first.ts?raw";
import { at, Frame } from "./frame";

at("source").textContent = source;
void Frame.open(async () => {
  const { camera, pass } = await import("./first");
  return { camera, output: () => pass };
});
