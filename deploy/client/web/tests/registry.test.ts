import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";

import { parseManifest } from "../src/manifest";
import { isLower } from "../src/release";
import { Registry, SignedOut } from "../src/registry";
import { Memory, Service, manifestOf } from "./published";

let service: Service;
let memory: Memory;
let registry: Registry;
const pull = () => registry.pull("glass", "champion");

beforeEach(async () => {
  [service, memory] = [new Service(), new Memory()];
  registry = new Registry(memory, service.fetch);
  await service.publish("1.0.0");
});
afterEach(() => vi.restoreAllMocks());

describe("a bundle that is right", () => {
  it("comes whole, and signed", async () => {
    const bundle = await pull();
    expect(bundle).toMatchObject({ name: "glass", version: "1.0.0", tail: { bins: 16 }, isSigned: true });
    expect(bundle.wgsl).toBe("fn of predict.wgsl");
    expect(new Set(service.asked).size).toBe(4);
  });

  it("is asked for with its ETag the next time, and may get newer", async () => {
    await pull();
    expect((await pull()).version).toBe("1.0.0");
    await service.publish("1.0.1", { content: "new" });
    expect(await pull()).toMatchObject({ version: "1.0.1", wgsl: "new of predict.wgsl" });
  });

  it("is taken without its signature where the browser has no Ed25519, and its key is not trusted", async () => {
    vi.spyOn(crypto.subtle, "importKey").mockRejectedValue(new DOMException("no", "NotSupportedError"));
    expect((await pull()).isSigned).toBe(false);
    expect(memory.getItem("diaphane key")).toBeNull();
  });
});

describe("a bundle that is refused", () => {
  const forged: Record<string, () => unknown> = {
    "a changed network": () => service.tamper("predict.wgsl", "Fn of predict.wgsl"),
    "a longer file": () => service.tamper("weights.safetensors", "fn of weights.safetensors "),
    "a changed manifest": () => service.tamper("manifest.json", "{}"),
    "a missing file": () => service.blobs.clear(),
    "another signature": () => (service.record["signature"] = Buffer.alloc(64).toString("base64")),
    "a signature that is none": () => (service.record["signature"] = "?"),
    "another version than was signed": () => (service.record["version"] = "9.0.0"),
    "another name than was asked for": () => (service.record["name"] = "smoke"),
    "another digest": () => (service.record["digest"] = "0".repeat(64)),
    "a file that was not signed": () => {
      const files = service.record["files"] as Record<string, unknown>;
      files["predict.wgsl"] = files["manifest.json"];
    },
    "a record that is none": () => (service.record = { items: [] }),
  };
  it.each(Object.keys(forged))("%s", async (what) => {
    forged[what]!();
    await expect(pull()).rejects.toThrow(/server|published|address|file/i);
    expect(memory.kept.size).toBe(0);
  });

  it("an older version than was seen, until that is forgotten", async () => {
    await service.publish("1.2.0");
    await pull();
    await service.publish("1.1.9");
    await expect(pull()).rejects.toThrow("was 1.2.0 before");
    registry.forget("glass", "champion");
    expect((await pull()).version).toBe("1.1.9");
  });

  it("other files under the same version", async () => {
    await pull();
    await service.publish("1.0.0", { content: "other" });
    await expect(pull()).rejects.toThrow("other files");
  });

  it("another key than the first", async () => {
    await pull();
    await service.publish("1.1.0", { newKey: true });
    await expect(pull()).rejects.toThrow("another key");
  });

  it("a memory that was tampered with is no way round the order", async () => {
    await service.publish("2.0.0");
    await pull();
    const seen = JSON.parse(memory.getItem("diaphane glass@champion")!);
    expect(JSON.parse(seen.record).version).toBe("2.0.0");
    memory.setItem("diaphane glass@champion", JSON.stringify({ ...seen, record: "{}" }));
    expect((await pull()).version).toBe("2.0.0");
  });

  it("names that lead elsewhere are not asked for", async () => {
    await expect(registry.pull("../keys", "champion")).rejects.toThrow("can be no");
    expect(service.asked).toEqual([]);
  });

  it("a connection that breaks on the way, and an answer of something in between, are said", async () => {
    const broken = () => new ReadableStream({ pull: (stream) => stream.error(new TypeError("network error")) });
    const half = async (address: RequestInfo | URL, options?: RequestInit): Promise<Response> =>
      String(address).includes("/blobs/") ? new Response(broken()) : service.fetch(address, options);
    await expect(new Registry(memory, half).pull("glass", "champion")).rejects.toThrow("cannot be reached");
    expect(memory.kept.size).toBe(0);
    const page = async (): Promise<Response> => new Response("<!doctype html>");
    await expect(new Registry(memory, page).choices()).rejects.toThrow("cannot be understood");
  });

  it("whoever is signed out is told so", async () => {
    service.status = 401;
    await expect(pull()).rejects.toBeInstanceOf(SignedOut);
  });
});

describe("a manifest", () => {
  const file = { sha256: "0".repeat(64), bytes: 1 };
  const parse = (change: Record<string, unknown>) =>
    parseManifest(JSON.stringify({ ...manifestOf({ "predict.wgsl": file }), ...change }));

  it("is read", () => expect(parse({}).tail.bins).toBe(16));
  it("may have a network of importances", () => {
    const self_test = { features: [[1]], outputs: [[0.5]], output_scale: [1], tolerance: {} };
    expect(parse({ head: "importance", outputs: ["importance"], self_test }).selfTest).toEqual(self_test);
  });
  it.each([
    [{ surprise: 1 }, "surprise is unknown"],
    [{ parity: undefined }, "parity is missing"],
    [{ format: "diaphane-bundle/3" }, "format"],
    [{ tail: { name: "density-4", g: 1 } }, "density-4"],
    [{ tail: { name: "density", g: 1 } }, "a tail without depth bins"],
    [{ tail: { name: "density-16", g: -1 } }, "density-16"],
    [{ tail: { name: "density-16" } }, "not finite"],
    [{ head: "importance" }, "head"],
    [{ head: "toString" }, "head"],
    [{ features: [{ name: "log_n", mean: 0, std: 0 }] }, "spread"],
    [{ files: { "../x": file } }, "name or hash"],
    [{ files: { "predict.glsl": file } }, "no predict.wgsl"],
    [{ files: { "predict.wgsl": { ...file, bytes: -1 } } }, "size"],
    [{ self_test: { features: [[1, 2]], outputs: [[1, 2]], output_scale: [1, 1], tolerance: {} } }, "self-test"],
  ])("%j is refused", (change, why) => expect(() => parse(change)).toThrow(why));
});

it("versions are compared as numbers", () => {
  expect(isLower("1.9.0", "1.10.0")).toBe(true);
  expect(isLower("1.10.0", "1.9.0")).toBe(false);
  expect(isLower("1.0.0", "1.0.0")).toBe(false);
});

it("models are not asked for where nobody is signed in", async () => {
  service.isSignedIn = false;
  await expect(registry.choices()).rejects.toThrow(SignedOut);
  expect(service.asked).toEqual(["/demo/session"]);
});
