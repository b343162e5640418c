// A bundle that an application has among its own files, and trusts as it trusts itself.

import type { Bundle } from "./bundle";
import { NETWORK, parseManifest } from "./manifest";
import { sha256 } from "./release";
import { Trouble } from "./trouble";

/**
 * Makes a bundle of two of its files.
 *
 * @param manifest Text of `manifest.json`.
 * @param wgsl Text of `predict.wgsl`.
 * @throws Trouble They are not those of one bundle, or of none that can be rendered with.
 */
export async function shippedBundle(manifest: string, wgsl: string): Promise<Bundle> {
  const remedy = "Copy both files from the folder of one bundle.";
  try {
    const { tail, files, selfTest } = parseManifest(manifest);
    const { sha256: wanted } = files[NETWORK]!;
    if ((await sha256(new TextEncoder().encode(wgsl))) !== wanted) throw new Error(`${NETWORK} has another hash`);
    return { name: String(JSON.parse(manifest).name), version: "", tail, wgsl, selfTest, isSigned: false };
  } catch (error) {
    throw new Trouble(`The bundle cannot be used: ${(error as Error).message}.`, remedy);
  }
}
