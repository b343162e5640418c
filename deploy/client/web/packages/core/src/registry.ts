// Published bundles, from the registry of the server that this page comes from: asked with the dashboard's session,
// verified, and never by an older statement of what an alias means than was seen before.

import type { ModelPage, ProblemDocument } from "./api";
import type { Bundle } from "./bundle";
import { MANIFEST, NETWORK, object, parseManifest } from "./manifest";
import { parsePointer } from "./pointer";
import { type Release, parseRelease, sha256, verify } from "./release";
import { NOTHING, type Trust, advance, dumpTrust, forget, parseTrust } from "./trust";
import { Trouble } from "./trouble";

/** Where the registry answers to a session. */
export const REGISTRY = "/demo/v1";

/** Says whether this browser has a session. */
export const SESSION = "/demo/session";

const TRUST = "diaphane trust";
const NAME = /^[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?$/;
const SELECTOR = /^[a-z0-9](?:[a-z0-9.-]{0,38}[a-z0-9])?$/;

/** What is remembered between visits: what was seen of the server and its models. */
export type Memory = Pick<Storage, "getItem" | "setItem">;

/** What the server said, all of it. */
interface Answer {
  readonly headers: Headers;
  readonly content: ArrayBuffer;
}

/** A model that can be asked for. */
export interface Choice {
  readonly name: string;
  readonly selector: string;
  readonly version: string;
}

/** There is no session: whoever wants models has to sign in. */
export class SignedOut extends Trouble {
  constructor() {
    super("Nobody is signed in.", "Sign in to render with a published model.");
  }
}

export class Registry {
  /**
   * @param memory Of this browser.
   * @param ask `fetch`.
   * @param now Of this machine's clock, seconds since 1970.
   */
  constructor(
    private readonly memory: Memory,
    private readonly ask: typeof fetch = (...args) => fetch(...args),
    private readonly now: () => number = () => Date.now() / 1000,
  ) {}

  /** All aliases of all models, champions first. */
  async choices(): Promise<Choice[]> {
    // Asked first: the browser writes an error on its console where a request is refused.
    const { signed_in: isSignedIn } = parsed(await this.#get(SESSION)) as { signed_in?: unknown };
    if (isSignedIn !== true) throw new SignedOut();
    const found: Choice[] = [];
    let address: string | null = `${REGISTRY}/models?limit=200`;
    while (address) {
      const answer: Answer = await this.#get(address);
      const page = parsed(answer) as ModelPage;
      for (const { name, aliases, latest } of page.items) {
        const known = Object.entries(aliases);
        for (const [selector, version] of known) found.push({ name, selector, version });
        if (known.length === 0) found.push({ name, selector: latest, version: latest });
      }
      address = nextOf(answer);
    }
    const rank = (choice: Choice): number => (choice.selector === "champion" ? 0 : 1);
    return found.sort((a, b) => rank(a) - rank(b));
  }

  /**
   * Fetches a bundle and verifies it.
   *
   * @throws Trouble A hash, a signature, a key, a time, a version or the manifest is not what it must be.
   */
  async pull(name: string, selector: string): Promise<Bundle> {
    if (!NAME.test(name) || !SELECTOR.test(selector)) {
      throw new Trouble(`There can be no '${name}' ${selector}.`, "Choose a model of the list.");
    }
    const pointed = await this.#asked(`${REGISTRY}/models/${name}/pointers/${selector}`);
    const { pointer, isSigned } = await parsePointer(pointed);
    // Read, judged and kept at once: another page of this browser may do the same.
    const trust = advance(parseTrust(this.memory.getItem(TRUST)), name, selector, pointer, this.now());
    if (isSigned) this.memory.setItem(TRUST, dumpTrust(trust));
    const release = parseRelease(await this.#asked(`${REGISTRY}/models/${name}/versions/${pointer.version}`));
    await verify(release, pointer);
    return { ...(await this.#bundle(release)), isSigned };
  }

  /** Forgets the trusted key, and what was seen of a model; all, where that cannot be read. */
  forget(name: string): void {
    let trust: Trust;
    try {
      trust = forget(parseTrust(this.memory.getItem(TRUST)), name);
    } catch {
      trust = NOTHING;
    }
    this.memory.setItem(TRUST, dumpTrust(trust));
  }

  /** What the server answers now, and no memory in between. */
  async #asked(address: string): Promise<string> {
    return text((await this.#get(address, { cache: "no-store" })).content);
  }

  async #bundle(release: Release): Promise<Omit<Bundle, "isSigned">> {
    const { name, version, files } = release;
    const manifestText = text(await this.#file(release, MANIFEST));
    let manifest;
    try {
      manifest = parseManifest(manifestText);
    } catch (error) {
      const why = error instanceof Error ? error.message : String(error);
      throw new Trouble(`'${name}' ${version} cannot be rendered here: ${why}.`, "Choose another model.");
    }
    const listed: Release["files"] = { ...manifest.files, [MANIFEST]: files[MANIFEST]! };
    const isSame = Object.keys({ ...listed, ...files }).every((file) => files[file]?.sha256 === listed[file]?.sha256);
    if (!isSame) {
      throw new Trouble(
        `The manifest of '${name}' ${version} lists other files than were published.`,
        "Publish it again.",
      );
    }
    // Every file, though only one is compiled: a damaged bundle is not half right.
    const others = Object.keys(manifest.files);
    const contents = await Promise.all(others.map((file) => this.#file(release, file)));
    const wgsl = text(contents[others.indexOf(NETWORK)]!);
    return { name, version, tail: manifest.tail, wgsl, selfTest: manifest.selfTest };
  }

  /** A file of a release, whose size and hash are right. */
  async #file(release: Release, name: string): Promise<ArrayBuffer> {
    const { sha256: hash, bytes } = release.files[name]!;
    const { content } = await this.#get(`${REGISTRY}/blobs/sha256/${hash}`);
    if (content.byteLength !== bytes || (await sha256(content)) !== hash) {
      throw new Trouble(
        `${name} of '${release.name}' ${release.version} is not the file that was published.`,
        "Load the page again; if it stays so, ask who runs the server.",
      );
    }
    return content;
  }

  async #get(address: string, options: RequestInit = {}): Promise<Answer> {
    let answer: Response;
    let content: ArrayBuffer;
    try {
      answer = await this.ask(address, { credentials: "same-origin", redirect: "error", ...options });
      content = await answer.arrayBuffer(); // a connection may break on the way
    } catch {
      throw new Trouble("The server cannot be reached.", "Check the connection, then try again.");
    }
    const { ok, status, headers } = answer;
    if (ok) return { headers, content };
    if (status === 401) throw new SignedOut();
    const problem = problemOf(content);
    throw new Trouble(
      problem.detail || problem.title || `The server answered ${status}.`,
      problem.remedy || "Try again.",
    );
  }
}

const text = (content: ArrayBuffer): string => new TextDecoder().decode(content);

function parsed({ content }: Answer): unknown {
  try {
    return JSON.parse(text(content));
  } catch {
    throw new Trouble("The server's answer cannot be understood.", "Ask who runs it: something may be in between.");
  }
}

function problemOf(content: ArrayBuffer): Partial<ProblemDocument> {
  try {
    return object(JSON.parse(text(content)));
  } catch {
    return {};
  }
}

function nextOf(answer: Answer): string | null {
  return /<(\/demo\/v1\/models[^>]*)>; rel="next"/.exec(answer.headers.get("link") ?? "")?.[1] ?? null;
}
