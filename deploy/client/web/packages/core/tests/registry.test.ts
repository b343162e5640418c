import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";

import { parseManifest } from "../src/manifest";
import { Registry, SignedOut } from "../src/registry";
import { sha256 } from "../src/release";
import { shippedBundle } from "../src/shipped";
import { Key, Memory, Service, manifestOf } from "./published";

let service: Service;
let memory: Memory;
let registry: Registry;
const pull = () => registry.pull("glass", "champion");

beforeEach(async () => {
  [service, memory] = [new Service(), new Memory()];
  registry = new Registry(memory, service.fetch, () => service.time);
  await service.publish("1.0.0");
});
afterEach(() => vi.restoreAllMocks());

describe("a bundle that is right", () => {
  it("comes whole, and signed", async () => {
    const bundle = await pull();
    expect(bundle).toMatchObject({ name: "glass", version: "1.0.0", tail: { bins: 16 }, isSigned: true });
    expect(bundle.wgsl).toBe("fn of predict.wgsl");
    expect(new Set(service.asked).size).toBe(5);
  });

  it("is asked for anew the next time, and may get newer", async () => {
    await pull();
    expect((await pull()).version).toBe("1.0.0");
    await service.publish("1.0.1", { content: "new" });
    expect(await pull()).toMatchObject({ version: "1.0.1", wgsl: "new of predict.wgsl" });
  });

  it("is taken without its signature where the browser has no Ed25519, and its key is not trusted", async () => {
    vi.spyOn(crypto.subtle, "importKey").mockRejectedValue(new DOMException("no", "NotSupportedError"));
    expect((await pull()).isSigned).toBe(false);
    expect(memory.kept.size).toBe(0);
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
    await service.publish("1.0.1");
    expect((await pull()).version).toBe("1.0.1");
  });

  it("other files under the same version", async () => {
    await pull();
    await service.publish("1.0.0", { content: "other" });
    await expect(pull()).rejects.toThrow("other files");
  });

  it("names that lead elsewhere are not asked for", async () => {
    await expect(registry.pull("../keys", "champion")).rejects.toThrow("can be no");
    expect(service.asked).toEqual([]);
  });

  it("a connection that breaks on the way, and an answer of something in between, are said", async () => {
    const broken = () => new ReadableStream({ pull: (stream) => stream.error(new TypeError("network error")) });
    const half = async (address: RequestInfo | URL, options?: RequestInit): Promise<Response> =>
      String(address).includes("/blobs/") ? new Response(broken()) : service.fetch(address, options);
    const cut = new Registry(memory, half, () => service.time);
    await expect(cut.pull("glass", "champion")).rejects.toThrow("cannot be reached");
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
    [{ head: "", outputs: [] }, "head"],
    [{ outputs: ["prior"] }, "head"],
    [{ tail: { name: "binned-8", g: 1 } }, "head"],
    [{ features: [{ name: "log_n", mean: 0, std: 0 }] }, "spread"],
    [{ files: { "../x": file } }, "name or hash"],
    [{ files: { "predict.glsl": file } }, "no predict.wgsl"],
    [{ files: { "predict.wgsl": { ...file, bytes: -1 } } }, "size"],
    [{ self_test: { features: [[1, 2]], outputs: [[1, 2]], output_scale: [1, 1], tolerance: {} } }, "self-test"],
  ])("%j is refused", (change, why) => expect(() => parse(change)).toThrow(why));
});

describe("what an alias means", () => {
  it("goes back only by a newer statement", async () => {
    const before = service.pointers.get("champion")!;
    await pull();
    const first = service.record;
    await service.publish("1.1.0");
    await pull();
    service.pointers.set("champion", before);
    await expect(pull()).rejects.toThrow("1.0.0, where it was 1.1.0 later");
    service.record = first;
    await service.move();
    expect((await pull()).version).toBe("1.0.0");
  });

  it("is one version at a time, and each alias moves by itself", async () => {
    await service.move("champion", { serial: 1000 });
    await pull();
    await service.publish("1.1.0");
    await service.move("trial", { serial: 1 });
    expect((await registry.pull("glass", "trial")).version).toBe("1.1.0");
    await service.move("champion", { serial: 1000 });
    await expect(pull()).rejects.toThrow("at once");
  });

  it("holds for minutes, whatever the clock says afterwards", async () => {
    const start = service.time;
    const old = await service.move("trial");
    await pull();
    service.time = start + 1199;
    expect((await pull()).version).toBe("1.0.0");
    service.time = start + 1200;
    await expect(pull()).rejects.toThrow("old answers");
    await service.move();
    expect((await pull()).version).toBe("1.0.0");
    service.pointers.set("trial", old);
    service.time = start;
    await expect(registry.pull("glass", "trial")).rejects.toThrow("was seen here");
  });

  it("is not taken from the future, or for ever", async () => {
    await service.move("champion", { issued: service.time + 301, expires: service.time + 900 });
    await expect(pull()).rejects.toThrow("yet to come");
    await service.move("champion", { expires: service.time + 100_000 });
    await expect(pull()).rejects.toThrow("too long");
    await service.move("champion", { issued: 1_000_000_000, expires: 1_000_000_900 });
    await expect(pull()).rejects.toThrow("expired at 2001");
    service.status = 304;
    await expect(pull()).rejects.toThrow("304");
    expect(memory.kept.size).toBe(0);
  });

  it("is said of what was asked for", async () => {
    for (const said of [{ selector: "trial" }, { name: "smoke" }, { selector: "1.0.0" }]) {
      await service.move("champion", said);
      await expect(pull()).rejects.toThrow("not about 'glass' champion");
    }
    await service.move("2.0.0");
    await expect(registry.pull("glass", "2.0.0")).rejects.toThrow("1.0.0 for 'glass' 2.0.0");
  });

  const mistakes: Record<string, unknown>[] = [
    { serial: -1 },
    { serial: 0.5 },
    { serial: null },
    { issued: "now" },
    { expires: 2 ** 60 },
    { version: "1.0" },
    { digest: "0" },
    { format: "diaphane-release/1" },
    { surprise: 1 },
    { name: undefined },
  ];
  it.each(mistakes)("is no statement with %j", async (said) => {
    await service.move("champion", said);
    await expect(pull()).rejects.toThrow("is not one");
  });

  it("has a signature that no letter may change of", async () => {
    const genuine = service.pointers.get("champion")!;
    for (const member of ["statement", "signature", "public_key"]) {
      const text = genuine[member] as string;
      for (let at = 0; at < text.length; at++) {
        const letter = String.fromCharCode(text.charCodeAt(at) ^ 1);
        service.pointers.set("champion", { ...genuine, [member]: text.slice(0, at) + letter + text.slice(at + 1) });
        await expect(pull()).rejects.toThrow("is not one");
      }
    }
  });
});

describe("the key", () => {
  it("is the first one that was seen, or one that it handed over to", async () => {
    await pull();
    const old = await service.key();
    await service.changeKey(await Key.make(), true);
    await service.changeKey(await Key.make(), true);
    await service.publish("1.1.0");
    expect((await pull()).version).toBe("1.1.0");
    await service.changeKey(old, false);
    await service.publish("1.2.0");
    await expect(pull()).rejects.toThrow("handed over to another one");
    await service.changeKey(await Key.make(), true); // a thief names a successor
    await service.publish("1.3.0");
    await expect(pull()).rejects.toThrow("did not hand over");
  });

  it("makes nothing older new", async () => {
    const before = service.pointers.get("champion")!;
    const first = service.record;
    await service.publish("1.2.0");
    await pull();
    await service.changeKey(await Key.make(), true);
    service.record = first;
    await service.move("champion", { serial: 1 });
    await expect(pull()).rejects.toThrow("older than one");
    service.pointers.set("champion", before);
    await expect(pull()).rejects.toThrow("older than one");
  });

  it("is another one only where the old one is forgotten", async () => {
    await pull();
    await service.changeKey(await Key.make(), false);
    await service.publish("0.9.0");
    await expect(pull()).rejects.toThrow("did not hand over");
    registry.forget("glass");
    expect((await pull()).version).toBe("0.9.0");
  });

  it("is not found by a row of handovers with a gap", async () => {
    await pull();
    await service.changeKey(await Key.make(), true);
    await service.changeKey(await Key.make(), true);
    const row = service.handovers;
    for (const wrong of [row.slice(0, 1), row.slice(1), [...row].reverse(), [...row, row[0]!], Array(65).fill(row[0])]) {
      service.handovers = wrong;
      await service.publish("1.1.0");
      await expect(pull()).rejects.toThrow();
    }
    const forged = { ...row[1]!, signature: row[0]!["signature"] };
    service.handovers = [row[0]!, forged];
    await service.publish("1.1.0");
    await expect(pull()).rejects.toThrow("is not one");
  });
});

describe("what this browser saw", () => {
  it("is kept before the files are there", async () => {
    const before = service.pointers.get("champion")!;
    await service.publish("1.1.0");
    service.blobs.clear();
    await expect(pull()).rejects.toThrow("no such file");
    service.pointers.set("champion", before);
    await expect(pull()).rejects.toThrow("older than one");
  });

  it.each(["{", "[]", "null", "{}", '{"format":"diaphane-trust/1","key":1,"retired":[],"names":{}}'])(
    "is not taken for nothing where it is %s",
    async (content) => {
      memory.setItem("diaphane trust", content);
      await expect(pull()).rejects.toThrow("cannot be read");
      registry.forget("glass");
      expect((await pull()).version).toBe("1.0.0");
    },
  );
});

it("models are not asked for where nobody is signed in", async () => {
  service.isSignedIn = false;
  await expect(registry.choices()).rejects.toThrow(SignedOut);
  expect(service.asked).toEqual(["/demo/session"]);
});

it("a bundle among an application's own files is taken if they belong together", async () => {
  const wgsl = "fn of predict.wgsl";
  const content = new TextEncoder().encode(wgsl);
  const files = { "predict.wgsl": { sha256: await sha256(content), bytes: content.length } };
  const manifest = JSON.stringify(manifestOf(files));
  expect(await shippedBundle(manifest, wgsl)).toMatchObject({ name: "glass", wgsl, tail: { bins: 16 } });
  await expect(shippedBundle(manifest, `${wgsl} `)).rejects.toThrow("predict.wgsl has another hash");
  await expect(shippedBundle("{}", wgsl)).rejects.toThrow("its format");
});
