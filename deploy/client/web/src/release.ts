// A published version as the server describes it, believed only as far as its signature goes.
//
// - the statement is the exact text that is signed; what the record says beside it must be the same;
// - the digest follows from the names and hashes of the files.

import type { FileRef, VersionRecord } from "./api";
import { Trouble } from "./trouble";
import { MANIFEST, object, parseFiles } from "./manifest";

export type Release = Pick<VersionRecord, "name" | "version" | "digest" | "statement" | "signature" | "public_key"> & {
  readonly files: Readonly<Record<string, FileRef>>;
};

const STATEMENT = "diaphane-release/1";
const SERVED_WRONG = "Ask who runs the server: it may be misconfigured, or somebody may have tampered with it.";
const NOT_A_RECORD = "The server's answer is not the record of a version.";

/** Reads a version's record. Nothing in it is believed before `verify`. */
export function parseRelease(content: string): Release {
  try {
    const fields = object(JSON.parse(content));
    const text = (name: string): string => {
      const value = fields[name];
      if (typeof value !== "string") throw new Error("a text is not one");
      return value;
    };
    const files = parseFiles(fields["files"]);
    if (!(MANIFEST in files)) throw new Error("there is no manifest");
    return {
      name: text("name"),
      version: text("version"),
      digest: text("digest"),
      statement: text("statement"),
      signature: text("signature"),
      public_key: text("public_key"),
      files,
    };
  } catch {
    throw new Trouble(NOT_A_RECORD, "Load the page again.");
  }
}

/** A semantic version as numbers; empty if it is none. */
export function versionOrder(version: string): number[] {
  const found = /^(\d{1,6})\.(\d{1,6})\.(\d{1,6})$/.exec(version);
  return found ? found.slice(1).map(Number) : [];
}

/** Whether one version is lower than another. */
export function isLower(one: string, other: string): boolean {
  const [a, b] = [versionOrder(one), versionOrder(other)];
  const at = [0, 1, 2].find((i) => a[i] !== b[i]);
  return at !== undefined && (a[at] ?? -1) < (b[at] ?? -1);
}

/**
 * Checks that a release is what was asked for, and signed with the trusted key.
 *
 * @param trusted Public key, base64; null: none is known yet, and the release's own is taken.
 * @returns Whether the signature could be checked: a browser may not know Ed25519.
 * @throws Trouble It is not what it must be.
 */
export async function verify(
  release: Release,
  name: string,
  selector: string,
  trusted: string | null,
): Promise<boolean> {
  if (trusted !== null && release.public_key !== trusted) {
    throw new Trouble(
      `'${name}' is signed with another key than this browser trusts.`,
      "If the server's key was changed on purpose, forget the trusted key below.",
    );
  }
  const signed = await isSigned(release);
  if (signed === false) throw new Trouble(`The signature of '${name}' ${release.version} is wrong.`, SERVED_WRONG);
  let statement: Record<string, unknown>;
  try {
    statement = object(JSON.parse(release.statement));
  } catch {
    throw new Trouble(`The statement of '${name}' cannot be read.`, SERVED_WRONG);
  }
  const said = { format: STATEMENT, name, version: release.version, digest: release.digest, files: release.files };
  const differs = Object.entries(said).some(([member, value]) => canonical(statement[member]) !== canonical(value));
  if (differs) throw new Trouble(`The record of '${name}' does not say what its signature is for.`, SERVED_WRONG);
  if (release.name !== name || release.digest !== (await digestOf(release.files))) {
    throw new Trouble(`The record of '${name}' contradicts itself.`, SERVED_WRONG);
  }
  if (versionOrder(selector).length && release.version !== selector) {
    throw new Trouble(`The server has ${release.version} for '${name}' ${selector}.`, SERVED_WRONG);
  }
  return signed !== null;
}

/** Hex sha256 of bytes. */
export async function sha256(content: BufferSource): Promise<string> {
  const digest = await crypto.subtle.digest("SHA-256", content);
  return Array.from(new Uint8Array(digest), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

async function digestOf(files: Readonly<Record<string, FileRef>>): Promise<string> {
  const hashes = Object.fromEntries(Object.entries(files).map(([name, file]) => [name, file.sha256]));
  return sha256(new TextEncoder().encode(canonical(hashes)));
}

/** Whether the signature is right; null where the browser cannot tell. */
async function isSigned(release: Release): Promise<boolean | null> {
  let key: CryptoKey;
  const bytes = decoded(release.public_key);
  const signature = decoded(release.signature);
  if (bytes?.length !== 32 || signature?.length !== 64) return false;
  try {
    key = await crypto.subtle.importKey("raw", bytes, { name: "Ed25519" }, false, ["verify"]);
  } catch (error) {
    if (error instanceof DOMException && error.name === "NotSupportedError") return null;
    return false;
  }
  return crypto.subtle.verify({ name: "Ed25519" }, key, signature, new TextEncoder().encode(release.statement));
}

function decoded(base64: string): Uint8Array<ArrayBuffer> | null {
  try {
    return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  } catch {
    return null;
  }
}

/** JSON with members in the order of their names and no space, as the service signs it. */
function canonical(value: unknown): string {
  if (typeof value !== "object" || value === null || Array.isArray(value)) return JSON.stringify(value) ?? "";
  const members = Object.entries(value).sort(([a], [b]) => (a < b ? -1 : 1));
  return `{${members.map(([name, each]) => `${JSON.stringify(name)}:${canonical(each)}`).join(",")}}`;
}
