// What an alias means now, as the server states it: signed, and for a short time. Whether its key, its time and its
// number are to be believed is decided in `trust.ts`.

import type { HandoverRecord, PointerRecord } from "./api";
import { object } from "./manifest";
import { versionOrder } from "./release";
import { isSigned } from "./signatures";
import { Trouble } from "./trouble";

export interface Pointer {
  readonly name: string;
  /** Alias, or the version itself. */
  readonly selector: string;
  readonly version: string;
  readonly digest: string;
  /** Number of the alias's last move; 0 for a version. */
  readonly serial: number;
  /** Seconds since 1970. */
  readonly issued: number;
  /** Seconds since 1970. */
  readonly expires: number;
  /** Public keys, base64, each of which handed over to the next; the last one signed this. */
  readonly keys: readonly string[];
}

const POINTER = "diaphane-pointer/1";
const HANDOVER = "diaphane-handover/1";
const MAX_HANDOVERS = 64;
const MEMBERS = ["digest", "expires", "format", "issued", "name", "selector", "serial", "version"];

/**
 * Reads a server's answer, and checks its signatures.
 *
 * @returns With whether they could be checked: a browser may not know Ed25519.
 * @throws Trouble It is not a pointer, or one of its signatures is wrong.
 */
export async function parsePointer(content: string): Promise<{ pointer: Pointer; isSigned: boolean }> {
  try {
    const answer = object(JSON.parse(content)) as unknown as PointerRecord;
    const key = text(answer.public_key);
    const row = answer.handovers as readonly HandoverRecord[];
    if (!Array.isArray(row) || row.length > MAX_HANDOVERS) throw new Error("there are too many handovers");
    const checks = [isSigned(key, text(answer.statement), text(answer.signature))];
    const keys: string[] = [];
    for (const handover of row) {
      const said = object(JSON.parse(text(handover.statement)));
      const [from, to] = [text(said["from"]), text(said["to"])];
      if (said["format"] !== HANDOVER || from !== (keys.at(-1) ?? from)) throw new Error("a key is missing");
      checks.push(isSigned(from, handover.statement, text(handover.signature)));
      if (keys.length === 0) keys.push(from);
      keys.push(to);
    }
    if ((keys.at(-1) ?? key) !== key) throw new Error("the handovers lead to another key");
    const verdicts = await Promise.all(checks);
    if (verdicts.includes(false)) throw new Error("a signature is wrong");
    const said = object(JSON.parse(answer.statement));
    if (said["format"] !== POINTER || Object.keys(said).sort().join() !== MEMBERS.join()) {
      throw new Error("it is another statement");
    }
    const pointer = {
      name: text(said["name"]),
      selector: text(said["selector"]),
      version: text(said["version"]),
      digest: text(said["digest"]),
      serial: number(said["serial"]),
      issued: number(said["issued"]),
      expires: number(said["expires"]),
      keys: keys.length ? keys : [key],
    };
    if (!versionOrder(pointer.version).length || !/^[0-9a-f]{64}$/.test(pointer.digest)) throw new Error("no version");
    return { pointer, isSigned: !verdicts.includes(null) };
  } catch {
    throw new Trouble(
      "The server's statement of what the alias means is not one, or its signature is wrong.",
      "Load the page again; if it stays so, ask who runs the server.",
    );
  }
}

function text(value: unknown): string {
  if (typeof value !== "string") throw new Error("a text is not one");
  return value;
}

function number(value: unknown): number {
  if (!Number.isSafeInteger(value) || (value as number) < 0) throw new Error("a number is not one");
  return value as number;
}
