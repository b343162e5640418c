// What was seen of the server and its models, and what may follow it: rules without a network, a clock or a memory.
// They are those of the Python client (`trust.py`), but for keys given by hand and several servers:
//
// - a pointer is about the name and the alias that were asked for;
// - its key is the one that was seen, or that one handed over to it; a key that handed over is never believed again;
// - it is not expired, by this machine's clock, or by the latest statement that was seen where that is later;
// - the number of the alias's last move is not lower than it was; the same number means the same;
// - a version never has other files than it had before;
// - an alias may go back to an older version, by a move with a higher number.

import { object } from "./manifest";
import type { Pointer } from "./pointer";
import { versionOrder } from "./release";
import { Trouble } from "./trouble";

/** What an alias meant when it was asked for last. */
export interface Mark {
  readonly serial: number;
  readonly version: string;
  /** When that was signed, seconds since 1970. */
  readonly issued: number;
}

/** What was seen of a name: the key of its last statement, what aliases meant, the digest of every version. */
export interface Seen {
  readonly key: string;
  readonly marks: Readonly<Record<string, Mark>>;
  readonly versions: Readonly<Record<string, string>>;
}

/** What was seen of the server: its key, those that handed over, and the names. */
export interface Trust {
  readonly key: string | null;
  readonly retired: readonly string[];
  readonly names: Readonly<Record<string, Seen>>;
}

export const NOTHING: Trust = { key: null, retired: [], names: {} };

/** How far the clocks of the server and this machine may differ, seconds. */
export const SKEW = 300;
/** A statement that holds for longer, seconds, is refused: it could be served for ever. */
const MAX_LIFETIME = 86_400;

const FORMAT = "diaphane-trust/1";
const ASK = "Ask who runs the server: it may be misconfigured, or somebody may have tampered with it.";

/**
 * What is known once a pointer is believed.
 *
 * @param now Of this machine's clock, seconds since 1970.
 * @throws Trouble The pointer is not to be believed.
 */
export function advance(trust: Trust, name: string, selector: string, pointer: Pointer, now: number): Trust {
  const seen = own(trust.names, name);
  checkSubject(name, selector, pointer);
  checkKey(trust, seen, pointer);
  checkTime(seen, pointer, now);
  if (seen) checkOrder(seen, pointer);
  const before = own(seen?.marks, selector);
  const mark = { serial: pointer.serial, version: pointer.version, issued: Math.max(pointer.issued, before?.issued ?? 0) };
  const key = pointer.keys.at(-1)!;
  return {
    key,
    retired: [...new Set([...trust.retired, ...pointer.keys.slice(0, -1)])],
    names: {
      ...trust.names,
      [name]: {
        key,
        marks: { ...seen?.marks, [selector]: mark },
        versions: { ...seen?.versions, [pointer.version]: pointer.digest },
      },
    },
  };
}

/** What is known when a name, and the server's key, are to be as if they had never been seen. */
export function forget(trust: Trust, name: string): Trust {
  const { [name]: _, ...names } = trust.names;
  return { key: null, retired: trust.retired, names };
}

function checkSubject(name: string, selector: string, pointer: Pointer): void {
  if (pointer.name !== name || pointer.selector !== selector) {
    const about = `'${pointer.name}' ${pointer.selector}`;
    throw new Trouble(`The server's statement is about ${about}, not about '${name}' ${selector}.`, ASK);
  }
  if (versionOrder(selector).length && pointer.version !== selector) {
    throw new Trouble(`The server has ${pointer.version} for '${name}' ${selector}.`, ASK);
  }
}

function checkKey(trust: Trust, seen: Seen | undefined, pointer: Pointer): void {
  if (trust.retired.includes(pointer.keys.at(-1)!)) {
    throw new Trouble(
      `'${pointer.name}' is signed with a key that was handed over to another one.`,
      "Ask who runs the server: it may not use its new key everywhere, or the old one was stolen.",
    );
  }
  const known = [trust.key, seen?.key].filter((key) => key !== null && key !== undefined);
  if (!known.every((key) => pointer.keys.includes(key))) {
    throw new Trouble(
      `'${pointer.name}' is signed with a key to which the one that this browser trusts did not hand over.`,
      "If the server's key was changed on purpose, forget the trusted key below.",
    );
  }
}

function checkTime(seen: Seen | undefined, pointer: Pointer, now: number): void {
  const what = `The statement of what '${pointer.name}' ${pointer.selector} means`;
  if (pointer.issued > now + SKEW) {
    throw new Trouble(
      `${what} is of ${moment(pointer.issued)}, which is yet to come: it is ${moment(now)} here.`,
      "Set the clock of this machine, or of the server.",
    );
  }
  const lifetime = pointer.expires - pointer.issued;
  if (lifetime <= 0 || lifetime > MAX_LIFETIME) {
    throw new Trouble(`${what} holds until ${moment(pointer.expires)}, which is too long.`, ASK);
  }
  if (pointer.expires + SKEW <= now) {
    throw new Trouble(
      `${what} expired at ${moment(pointer.expires)}, and it is ${moment(now)}.`,
      "Set the clock of this machine; if it is right, something on the way to the server serves old answers.",
    );
  }
  // A clock that was set back must not make an old statement a new one.
  const latest = Math.max(0, ...Object.values(seen?.marks ?? {}).map((mark) => mark.issued));
  if (pointer.expires + SKEW <= latest) {
    throw new Trouble(
      `${what} expired at ${moment(pointer.expires)}, and one of ${moment(latest)} was seen here.`,
      "Set the clock of this machine; if it is right and the server's was wrong then, forget the model below.",
    );
  }
}

function checkOrder(seen: Seen, pointer: Pointer): void {
  const { name, selector, version } = pointer;
  if ((own(seen.versions, version) ?? pointer.digest) !== pointer.digest) {
    throw new Trouble(
      `'${name}' ${version} has other files than it had before.`,
      "Versions never change: ask who runs the server.",
    );
  }
  const before = own(seen.marks, selector);
  if (!before) return;
  if (pointer.serial < before.serial) {
    throw new Trouble(
      `The server's statement of what '${name}' ${selector} means is older than one that was seen here: ` +
        `${version}, where it was ${before.version} later.`,
      "Something may serve old answers; if the server's database was restored, move the alias once there.",
    );
  }
  if (pointer.serial === before.serial && version !== before.version) {
    throw new Trouble(`The server says that '${name}' ${selector} is ${version} and ${before.version} at once.`, ASK);
  }
}

/** What `parseTrust` reads back. */
export function dumpTrust(trust: Trust): string {
  return JSON.stringify({ format: FORMAT, ...trust });
}

/**
 * Reads what was kept; nothing was kept yet where it is null.
 *
 * @throws Trouble It is not what `dumpTrust` writes.
 */
export function parseTrust(content: string | null): Trust {
  if (content === null) return NOTHING;
  try {
    const { format, key, retired, names } = object(JSON.parse(content));
    if (format !== FORMAT || !(key === null || isText(key))) throw new Error("the format is another one");
    if (!Array.isArray(retired) || !retired.every(isText)) throw new Error("a key is not one");
    return { key, retired, names: mapped(names, seenOf) };
  } catch {
    throw new Trouble("What this browser saw of models cannot be read.", "Forget it below, and choose the model again.");
  }
}

function seenOf(value: unknown): Seen {
  const { key, marks, versions } = object(value);
  if (!isText(key)) throw new Error("a key is not one");
  return {
    key,
    marks: mapped(marks, markOf),
    versions: mapped(versions, (digest) => {
      if (!isText(digest)) throw new Error("a digest is not one");
      return digest;
    }),
  };
}

function markOf(value: unknown): Mark {
  const { serial, version, issued } = object(value);
  if (!Number.isSafeInteger(serial) || !Number.isSafeInteger(issued) || !isText(version)) throw new Error("no mark");
  return { serial: serial as number, version, issued: issued as number };
}

function mapped<T>(value: unknown, of: (each: unknown) => T): Readonly<Record<string, T>> {
  return Object.fromEntries(Object.entries(object(value)).map(([name, each]) => [name, of(each)]));
}

/** A member that was put there: names come from servers, and an object has others of its own. */
function own<T>(members: Readonly<Record<string, T>> | undefined, name: string): T | undefined {
  return members && Object.hasOwn(members, name) ? members[name] : undefined;
}

const isText = (value: unknown): value is string => typeof value === "string";

const moment = (seconds: number): string =>
  new Date(1000 * Math.min(seconds, 253_402_300_799)).toISOString().replace("T", " ").replace(/\.\d+Z/, " UTC");
