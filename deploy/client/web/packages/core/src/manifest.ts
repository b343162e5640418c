// A bundle's manifest, as far as this page needs it (deploy/client/python/diaphane_client/manifest.py has these rules).
//
// - members that are not known are refused, as are those that are needed and not there;
// - names of files are plain, sizes and hashes are such;
// - numbers are finite, spreads positive.

import type { FileRef } from "./api";
import type { SelfTest } from "./bundle";
import { type Tail, tailOf } from "./tail";

export const MANIFEST = "manifest.json";
export const NETWORK = "predict.wgsl";

const FORMAT = "diaphane-bundle/2";
const NEEDED = [
  ...["format", "name", "head", "outputs", "features", "hidden", "layers", "tail", "metric", "files"],
  ...["onnx", "self_test", "parity", "provenance", "evaluation"],
];
const MOST_BYTES = 64 * 2 ** 20;
const MOST_MANIFEST_BYTES = 2 ** 20;
const MOST_FILES = 16;
const MOST_FEATURES = 256;
const MOST_OUTPUTS = 64;

export interface Manifest {
  readonly tail: Tail;
  readonly files: Readonly<Record<string, FileRef>>;
  readonly selfTest: SelfTest;
}

/**
 * Reads a manifest.
 *
 * @throws Error It is not valid, or not one that this page renders; the message says why.
 */
export function parseManifest(content: string): Manifest {
  const fields = object(JSON.parse(content));
  if (fields["format"] !== FORMAT) throw new Error(`its format is not ${FORMAT}`);
  const missing = NEEDED.filter((name) => !(name in fields));
  if (missing.length) throw new Error(`${missing.join(", ")} is missing`);
  const unknown = Object.keys(fields).filter((name) => !NEEDED.includes(name));
  if (unknown.length) throw new Error(`${unknown.join(", ")} is unknown`);
  const { name, g } = object(fields["tail"]);
  const tail = tailOf(String(name));
  const head = String(fields["head"]);
  if (!tail || number(g) < 0) throw new Error(`it has a tail without depth bins, or an unknown one, ${name}`);
  if (String(fields["outputs"]) !== outputsOf(head, tail)) {
    throw new Error(`it has a head that is none, ${head} with ${fields["outputs"]}`);
  }
  const features = list(fields["features"], MOST_FEATURES);
  for (const feature of features.map(object)) {
    if (typeof feature["name"] !== "string" || !(number(feature["std"]) > 0))
      throw new Error("a feature has no spread");
    number(feature["mean"]);
  }
  const files = parseFiles(fields["files"]);
  if (!(NETWORK in files)) throw new Error(`there is no ${NETWORK}`);
  return { tail, files, selfTest: selfTestOf(fields, features.length) };
}

/** What a network of a head answers for a tail, in order; null: there is no such head. */
function outputsOf(head: string, { bins }: Tail): string | null {
  if (head === "importance") return "importance";
  return head === "bin-gains" ? [...Array.from({ length: bins }, (_, bin) => `gain_${bin}`), "prior"].join() : null;
}

/**
 * Names, sizes and hashes of files.
 *
 * @throws Error A name leads elsewhere, or a size or hash is none.
 */
export function parseFiles(listed: unknown): Record<string, FileRef> {
  const entries = Object.entries(object(listed)).map(([name, value]): [string, FileRef] => {
    const { sha256, bytes } = object(value);
    const most = name === MANIFEST ? MOST_MANIFEST_BYTES : MOST_BYTES;
    if (!/^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$/.test(name) || !/^[0-9a-f]{64}$/.test(String(sha256))) {
      throw new Error("a file has no proper name or hash");
    }
    if (!Number.isInteger(bytes) || number(bytes) < 0 || number(bytes) > most)
      throw new Error("a file has no proper size");
    return [name, { sha256: String(sha256), bytes: number(bytes) }];
  });
  if (entries.length === 0 || entries.length > MOST_FILES) throw new Error("there are no files, or too many");
  return Object.fromEntries(entries);
}

function selfTestOf(fields: Record<string, unknown>, inputs: number): SelfTest {
  const found = object(fields["self_test"]);
  const outputs = list(fields["outputs"], MOST_OUTPUTS).length;
  const rows = (value: unknown, wide: number): number[][] =>
    list(value, 1024).map((row) => {
      const numbers = list(row, 1024).map(number);
      if (numbers.length !== wide) throw new Error("the self-test is not of the size of the network");
      return numbers;
    });
  const test = { features: rows(found["features"], inputs), outputs: rows(found["outputs"], outputs) };
  if (test.features.length !== test.outputs.length || test.features.length === 0) {
    throw new Error("the self-test has no rows, or not as many answers");
  }
  const [scale] = rows([found["output_scale"]], outputs);
  const tolerance = Object.fromEntries(Object.entries(object(found["tolerance"])).map(([k, v]) => [k, number(v)]));
  return { ...test, output_scale: scale!, tolerance };
}

export function object(value: unknown): Record<string, unknown> {
  if (typeof value !== "object" || value === null || Array.isArray(value))
    throw new Error("a member is of another type");
  return value as Record<string, unknown>;
}

function list(value: unknown, most: number): unknown[] {
  if (!Array.isArray(value) || value.length > most) throw new Error("a list is none, or too long");
  return value;
}

function number(value: unknown): number {
  if (typeof value !== "number" || !Number.isFinite(value)) throw new Error("a number is not finite");
  return value;
}
