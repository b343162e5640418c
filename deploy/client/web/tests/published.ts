// A registry with one model, in memory, as the service answers; and a browser's memory.

import { webcrypto } from "node:crypto";

import { sha256 } from "../src/release";

type Json = Record<string, unknown>;

const bytes = (text: string): Uint8Array<ArrayBuffer> => new TextEncoder().encode(text) as Uint8Array<ArrayBuffer>;
const base64 = (content: ArrayBuffer): string => Buffer.from(content).toString("base64");

export function manifestOf(files: Json): Json {
  return {
    format: "diaphane-bundle/2",
    name: "glass",
    head: "gain-curve",
    outputs: ["a", "b"],
    features: [{ name: "log_n", mean: 1, std: 2 }],
    hidden: [],
    layers: [],
    tail: { name: "density-16", g: 0.75 },
    metric: "display",
    files,
    onnx: {},
    self_test: { features: [[1]], outputs: [[2, 3]], output_scale: [1, 1], tolerance: { "predict.wgsl": 1e-4 } },
    parity: {},
    provenance: {},
    evaluation: {},
  };
}

export class Memory {
  readonly kept = new Map<string, string>();
  getItem = (key: string): string | null => this.kept.get(key) ?? null;
  setItem = (key: string, value: string): void => void this.kept.set(key, value);
  removeItem = (key: string): void => void this.kept.delete(key);
}

/** A service that has published versions of `glass`, and what was asked of it. */
export class Service {
  readonly asked: string[] = [];
  readonly blobs = new Map<string, Uint8Array<ArrayBuffer>>();
  record: Json = {};
  status = 200;
  isSignedIn = true;
  #key: webcrypto.CryptoKeyPair | null = null;

  /** Publishes a version with a key of its own, or that of the last one. */
  async publish(
    version: string,
    { content = "fn", newKey = false, edit = (manifest: Json): void => void manifest } = {},
  ) {
    if (!this.#key || newKey) {
      this.#key = (await webcrypto.subtle.generateKey("Ed25519", true, ["sign", "verify"])) as webcrypto.CryptoKeyPair;
    }
    const files: Record<string, { sha256: string; bytes: number }> = {};
    for (const name of ["predict.wgsl", "weights.safetensors"]) files[name] = await this.#blob(`${content} of ${name}`);
    const manifest = manifestOf({ ...files });
    edit(manifest);
    files["manifest.json"] = await this.#blob(JSON.stringify(manifest));
    const names = Object.keys(files).sort();
    const digest = await sha256(bytes(JSON.stringify(Object.fromEntries(names.map((n) => [n, files[n]!.sha256])))));
    const said = {
      created: "2026-01-01T00:00:00Z",
      digest,
      files,
      format: "diaphane-release/1",
      name: "glass",
      version,
    };
    const statement = JSON.stringify(said);
    const signature = base64(await webcrypto.subtle.sign("Ed25519", this.#key.privateKey, bytes(statement)));
    const public_key = base64(await webcrypto.subtle.exportKey("raw", this.#key.publicKey));
    this.record = { name: "glass", version, digest, files, statement, signature, public_key };
  }

  readonly fetch = async (address: RequestInfo | URL, options: RequestInit = {}): Promise<Response> => {
    const path = String(address);
    this.asked.push(path);
    if (this.status !== 200) return new Response('{"title":"No."}', { status: this.status });
    if (path === "/demo/session") return new Response(JSON.stringify({ signed_in: this.isSignedIn }));
    if (path.startsWith("/demo/v1/blobs/sha256/")) {
      const blob = this.blobs.get(path.split("/").at(-1)!);
      return blob ? new Response(blob) : new Response('{"detail":"There is no such file."}', { status: 404 });
    }
    const etag = `"${await sha256(bytes(JSON.stringify(this.record)))}"`;
    if (new Headers(options.headers).get("if-none-match") === etag) return new Response(null, { status: 304 });
    return new Response(JSON.stringify(this.record), { headers: { etag } });
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
