// A registry with one model, in memory, as the service answers; and a browser's memory.

import { webcrypto } from "node:crypto";

import { sha256 } from "../src/release";

type Json = Record<string, unknown>;

const bytes = (text: string): Uint8Array<ArrayBuffer> => new TextEncoder().encode(text) as Uint8Array<ArrayBuffer>;
const base64 = (content: ArrayBuffer): string => Buffer.from(content).toString("base64");

/** What a network answers for a tail of 16 bins. */
const OUTPUTS = [...Array.from({ length: 16 }, (_, bin) => `gain_${bin}`), "prior"];
const ANSWER = OUTPUTS.map(() => 1);

export function manifestOf(files: Json): Json {
  return {
    format: "diaphane-bundle/2",
    name: "glass",
    head: "bin-gains",
    outputs: OUTPUTS,
    features: [{ name: "log_n", mean: 1, std: 2 }],
    hidden: [],
    layers: [],
    tail: { name: "density-16", g: 0.75 },
    metric: "display",
    files,
    onnx: {},
    self_test: { features: [[1]], outputs: [ANSWER], output_scale: ANSWER, tolerance: { "predict.wgsl": 1e-4 } },
    parity: {},
    provenance: {},
    evaluation: {},
  };
}

export class Memory {
  readonly kept = new Map<string, string>();
  getItem = (key: string): string | null => this.kept.get(key) ?? null;
  setItem = (key: string, value: string): void => void this.kept.set(key, value);
}

/** A key that signs, or stops to. */
export class Key {
  private constructor(
    private readonly pair: webcrypto.CryptoKeyPair,
    readonly publicKey: string,
  ) {}

  static async make(): Promise<Key> {
    const pair = (await webcrypto.subtle.generateKey("Ed25519", true, ["sign", "verify"])) as webcrypto.CryptoKeyPair;
    return new Key(pair, base64(await webcrypto.subtle.exportKey("raw", pair.publicKey)));
  }

  async sign(text: string): Promise<string> {
    return base64(await webcrypto.subtle.sign("Ed25519", this.pair.privateKey, bytes(text)));
  }

  /** Names the key that follows this one. */
  async handOver(to: Key): Promise<Json> {
    const statement = canonical({ format: "diaphane-handover/1", from: this.publicKey, to: to.publicKey, issued: 1 });
    return { statement, signature: await this.sign(statement) };
  }
}

/** A service that has published versions of `glass`, and what was asked of it. */
export class Service {
  readonly asked: string[] = [];
  readonly blobs = new Map<string, Uint8Array<ArrayBuffer>>();
  /** Of the version that was published last. */
  record: Json = {};
  /** Selector -> what it means. */
  readonly pointers = new Map<string, Json>();
  status = 200;
  isSignedIn = true;
  /** Seconds since 1970. */
  time = 1_780_000_000;
  handovers: Json[] = [];
  #key: Key | null = null;
  #moves = 0;

  /** Publishes a version, and moves the champion to it. */
  async publish(version: string, { content = "fn", edit = (manifest: Json): void => void manifest } = {}) {
    const files: Record<string, { sha256: string; bytes: number }> = {};
    for (const name of ["predict.wgsl", "weights.safetensors"]) files[name] = await this.#blob(`${content} of ${name}`);
    const manifest = manifestOf({ ...files });
    edit(manifest);
    files["manifest.json"] = await this.#blob(JSON.stringify(manifest));
    const names = Object.keys(files).sort();
    const digest = await sha256(bytes(JSON.stringify(Object.fromEntries(names.map((n) => [n, files[n]!.sha256])))));
    const created = "2026-01-01T00:00:00Z";
    const statement = canonical({ created, digest, files, format: "diaphane-release/1", name: "glass", version });
    const key = await this.key();
    const signature = await key.sign(statement);
    this.record = { name: "glass", version, digest, files, statement, signature, public_key: key.publicKey };
    await this.move();
  }

  /** States that an alias moved to a version just now; `said` may be other than it should be. */
  async move(selector = "champion", said: Json = {}): Promise<Json> {
    const { version, digest } = this.record;
    const times = { issued: this.time, expires: this.time + 900 };
    const meant = { name: "glass", selector, version, digest, serial: ++this.#moves, ...times };
    const statement = canonical({ format: "diaphane-pointer/1", ...meant, ...said });
    const key = await this.key();
    const signature = await key.sign(statement);
    const pointer = { statement, signature, public_key: key.publicKey, handovers: this.handovers };
    this.pointers.set(selector, pointer);
    return pointer;
  }

  /** The key that signs. */
  async key(): Promise<Key> {
    return (this.#key ??= await Key.make());
  }

  /** Signs with another key from now on; whether the old one hands over to it. */
  async changeKey(key: Key, isHandedOver: boolean): Promise<void> {
    this.handovers = isHandedOver ? [...this.handovers, await (await this.key()).handOver(key)] : [];
    this.#key = key;
  }

  readonly fetch = async (address: RequestInfo | URL, options: RequestInit = {}): Promise<Response> => {
    const path = String(address);
    this.asked.push(path);
    if (this.status === 304) return new Response(null, { status: 304 });
    if (this.status !== 200) return new Response('{"title":"No."}', { status: this.status });
    if (path === "/demo/session") return new Response(JSON.stringify({ signed_in: this.isSignedIn }));
    if (path.startsWith("/demo/v1/blobs/sha256/")) {
      const blob = this.blobs.get(path.split("/").at(-1)!);
      return blob ? new Response(blob) : new Response('{"detail":"There is no such file."}', { status: 404 });
    }
    if (options.cache !== "no-store") throw new Error("an answer may be an old one");
    const selector = path.split("/").at(-1)!;
    return new Response(JSON.stringify(path.includes("/pointers/") ? this.pointers.get(selector) : this.record));
  };

  /** Another content under the hash of a file. */
  tamper(name: string, content: string): void {
    const files = this.record["files"] as Record<string, { sha256: string }>;
    this.blobs.set(files[name]!.sha256, bytes(content));
  }

  async #blob(text: string): Promise<{ sha256: string; bytes: number }> {
    const content = bytes(text);
    const hash = await sha256(content);
    this.blobs.set(hash, content);
    return { sha256: hash, bytes: content.byteLength };
  }
}

/** JSON as the service signs it, of members that are no objects but for the files. */
const canonical = (said: Json): string =>
  JSON.stringify(Object.fromEntries(Object.entries(said).sort(([a], [b]) => (a < b ? -1 : 1))));
