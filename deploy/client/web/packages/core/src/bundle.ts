// A verified bundle, as far as it is rendered with.

import type { Tail } from "./tail";

export interface SelfTest {
  readonly features: readonly (readonly number[])[];
  readonly outputs: readonly (readonly number[])[];
  readonly output_scale: readonly number[];
  readonly tolerance: Readonly<Record<string, number>>;
}

export interface Bundle {
  readonly name: string;
  readonly version: string;
  readonly tail: Tail;
  /** Its network: `predict.wgsl`. */
  readonly wgsl: string;
  readonly selfTest: SelfTest;
  /** Whether the signature could be checked; this browser may not know Ed25519. */
  readonly isSigned: boolean;
}
