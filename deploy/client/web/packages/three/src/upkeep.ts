// What three.js keeps of passes over its materials longer, or less often, than they need.

import type { ContextNode, MRTNode, WebGPURenderer } from "three/webgpu";
import { context } from "three/tsl";

type Drawn = { readonly context: { readonly mrt: MRTNode | null }; dispose(): void };
/** Members that three.js has for itself; where it has them no more, nothing is given back before the renderer is. */
type Inner = {
  readonly _objects?: { readonly _renderObjects?: Iterable<Drawn> };
  readonly _renderContexts?: { readonly _renderContexts?: Record<string, { readonly mrt: MRTNode | null }> };
};

const contexts = new WeakMap<ContextNode<unknown>, ContextNode<unknown>>();

/**
 * A renderer's context in which every object gets its uniforms and buffers anew. Without it three.js renews those of an
 * object and its material when these change, and does not see that a pass has other values for the same object.
 */
export function renewing(renderer: WebGPURenderer): ContextNode<unknown> {
  const before = renderer.contextNode as ContextNode<unknown>;
  let made = contexts.get(before);
  if (!made) {
    const told = before as unknown as { getFlowContextData(): { getAO?: (occlusion: unknown, builder: unknown) => unknown } };
    const { getAO } = told.getFlowContextData();
    // Of all that has this effect, it alone leaves the shading as it is.
    made = context(before, { getAO: getAO ?? ((occlusion: unknown) => occlusion) }) as unknown as ContextNode<unknown>;
    contexts.set(before, made);
  }
  return made;
}

/** Gives back what was made to draw objects with outputs that are no more; three.js keeps it as long as the objects. */
export function forget(renderer: WebGPURenderer, outputs: ReadonlySet<MRTNode>): void {
  const { _objects: objects, _renderContexts: kept } = renderer as unknown as Inner;
  const isGone = ({ mrt }: { readonly mrt: MRTNode | null }): boolean => mrt !== null && outputs.has(mrt);
  for (const each of [...(objects?._renderObjects ?? [])]) if (isGone(each.context)) each.dispose();
  const states = kept?._renderContexts ?? {};
  for (const [key, each] of Object.entries(states)) if (isGone(each)) delete states[key];
}
