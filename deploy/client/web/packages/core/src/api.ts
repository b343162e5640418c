// Written by scripts/api-types.mjs of docs/openapi.json: `npm run types`.

/** A page of names in the registry. */
export interface ModelPage {
  readonly items: readonly (ModelRecord)[];
}

/** What an alias means now, for clients to believe until it expires. */
export interface PointerRecord {
  readonly handovers?: readonly (HandoverRecord)[];
  readonly public_key: string;
  readonly signature: string;
  readonly statement: string;
}

/** `application/problem+json` (RFC 9457). */
export interface ProblemDocument {
  readonly detail?: string;
  readonly errors?: readonly (Readonly<Record<string, unknown>>)[];
  readonly instance?: string;
  readonly remedy?: string;
  readonly request_id?: string;
  readonly status: number;
  readonly title: string;
  readonly type: string;
}

/** A published version. */
export interface VersionRecord {
  readonly aliases?: readonly (string)[];
  readonly created: string;
  readonly digest: string;
  readonly evaluation: Readonly<Record<string, unknown>>;
  readonly files: Readonly<Record<string, FileRef>>;
  readonly job_id?: string | null;
  readonly name: string;
  readonly parity: Readonly<Record<string, unknown>>;
  readonly provenance: Readonly<Record<string, unknown>>;
  readonly public_key: string;
  readonly score: number | null;
  readonly signature: string;
  readonly statement: string;
  readonly version: string;
}

/** A name in the registry. */
export interface ModelRecord {
  readonly aliases: Readonly<Record<string, string>>;
  readonly latest: string;
  readonly name: string;
  readonly versions: number;
}

/** A signing key names the one that follows it. */
export interface HandoverRecord {
  readonly signature: string;
  readonly statement: string;
}

/** A file by content. */
export interface FileRef {
  readonly bytes: number;
  readonly sha256: string;
}
