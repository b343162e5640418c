"""ed25519 signatures over texts."""

from __future__ import annotations

import base64

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey


def is_signed(public_key: str, text: str, signature: str) -> bool:
    """Whether a signature over a text is that of a public key.

    Args:
        public_key: 32 bytes, base64.
        text: What was signed, as UTF-8.
        signature: 64 bytes, base64.
    """
    try:
        Ed25519PublicKey.from_public_bytes(_decoded(public_key)).verify(_decoded(signature), text.encode())
    except (InvalidSignature, ValueError):  # no base64, no key, or half of a surrogate pair: all are ValueErrors
        return False
    return True


def _decoded(text: str) -> bytes:
    """The bytes of base64, which have this one form: keys are compared as texts."""
    content = base64.b64decode(text, validate=True)
    if base64.b64encode(content).decode() != text:
        raise ValueError("bits that mean nothing are set")
    return content
