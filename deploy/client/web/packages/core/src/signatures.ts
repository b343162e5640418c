// Ed25519 signatures over texts.

/**
 * Whether a signature over a text is that of a public key; null where the browser cannot tell.
 *
 * @param publicKey 32 bytes, base64.
 * @param signature 64 bytes, base64.
 */
export async function isSigned(publicKey: string, text: string, signature: string): Promise<boolean | null> {
  let key: CryptoKey;
  const [bytes, signed] = [decoded(publicKey), decoded(signature)];
  if (bytes?.length !== 32 || signed?.length !== 64) return false;
  try {
    key = await crypto.subtle.importKey("raw", bytes, { name: "Ed25519" }, false, ["verify"]);
  } catch (error) {
    if (error instanceof DOMException && error.name === "NotSupportedError") return null;
    return false;
  }
  return crypto.subtle.verify({ name: "Ed25519" }, key, signed, new TextEncoder().encode(text));
}

/** The bytes of base64, which have this one form: keys are compared as texts. */
function decoded(base64: string): Uint8Array<ArrayBuffer> | null {
  try {
    const letters = atob(base64);
    return btoa(letters) === base64 ? Uint8Array.from(letters, (letter) => letter.charCodeAt(0)) : null;
  } catch {
    return null;
  }
}
