// Commands on their way to the GPU. What takes long is handed over bit by bit, so that the rest of the page, and of the
// machine, has its turns.

import type { Gpu } from "./gpu";

/** A picture was given up: something else is wanted by now. */
export class Abandoned extends Error {}

export class Work {
  #encoder: GPUCommandEncoder | null = null;

  /**
   * @param gpu The device.
   * @param isWanted Asked at every pause.
   */
  constructor(
    private readonly gpu: Gpu,
    private readonly isWanted: () => boolean = () => true,
  ) {}

  /** Records what comes next; not to be kept beyond a pause. */
  get encoder(): GPUCommandEncoder {
    return (this.#encoder ??= this.gpu.device.createCommandEncoder());
  }

  /** Hands over what was recorded. */
  submit(): void {
    if (this.#encoder) this.gpu.device.queue.submit([this.#encoder.finish()]);
    this.#encoder = null;
  }

  /**
   * Hands over what was recorded and waits until it is done.
   *
   * @throws Abandoned Nobody wants the rest.
   */
  async pause(): Promise<void> {
    this.submit();
    await this.gpu.device.queue.onSubmittedWorkDone();
    if (!this.isWanted()) throw new Abandoned();
  }
}
