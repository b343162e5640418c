// A published version as the server describes it, believed only as far as its signature goes.
//
// - it is the version that the pointer names, with that digest, and signed with the same key;
// - the statement is the exact text that is signed; what the record says beside it must be the same;
// - the digest follows from the names and hashes of the files.

import type { FileRef, VersionRecord } from "./api";
import type { Pointer } from "./pointer";
import { isSigned } from "./signatures";
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

/**
 * Checks that a release is what a pointer names, and that its signature holds as far as the browser can tell.
 *
 * @throws Trouble It is not what it must be.
 */
export async function verify(release: Release, pointer: Pointer): Promise<void> {
  const { name, version, digest } = pointer;
  if (release.name !== name || release.version !== version || release.digest !== digest) {
    throw new Trouble(
      `The server sent '${release.name}' ${release.version}, and states that '${name}' ${pointer.selector} is ` +
        `${version} with other files.`,
      SERVED_WRONG,
    );
  }
  if (release.public_key !== pointer.keys.at(-1)) {
    throw new Trouble(
      `'${name}' ${version} is signed with another key than the statement that names it.`,
      "If the server's key was changed a moment ago, try again; else ask who runs it.",
    );
  }
  if ((await isSigned(release.public_key, release.statement, release.signature)) === false) {
    throw new Trouble(`The signature of '${name}' ${version} is wrong.`, SERVED_WRONG);
  }
  let statement: Record<string, unknown>;
  try {
    statement = object(JSON.parse(release.statement));
  } catch {
    throw new Trouble(`The statement of '${name}' cannot be read.`, SERVED_WRONG);
  }
  const said = { format: STATEMENT, name, version, digest, files: release.files };
  const differs = Object.entries(said).some(([member, value]) => canonical(statement[member]) !== canonical(value));
  if (differs) throw new Trouble(`The record of '${name}' does not say what its signature is for.`, SERVED_WRONG);
  if (digest !== (await digestOf(release.files))) {
    throw new Trouble(`The record of '${name}' contradicts itself.`, SERVED_WRONG);
  }
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

/** JSON with members in the order of their names and no space, as the service signs it. */
function canonical(value: unknown): string {
  if (typeof value !== "object" || value === null || Array.isArray(value)) return JSON.stringify(value) ?? "";
  const members = Object.entries(value).sort(([a], [b]) => (a < b ? -1 : 1));
  return `{${members.map(([name, each]) => `${JSON.stringify(name)}:${canonical(each)}`).join(",")}}`;
}
