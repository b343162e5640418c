/** Something that a person can do something about. */
export class Trouble extends Error {
  /**
   * @param what What is wrong, one sentence.
   * @param remedy What to do about it, one sentence.
   */
  constructor(
    readonly what: string,
    readonly remedy: string,
  ) {
    super(`${what} ${remedy}`);
    this.name = "Trouble";
  }
}
