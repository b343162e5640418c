"""Signatures of the client: the vectors of RFC 8032, and texts that are no keys and no signatures."""

from __future__ import annotations

import base64

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diaphane_client.signatures import is_signed

ORDER = 2**252 + 27742317777372353535851937790883648493

# RFC 8032, section 7.1, tests 1 and 2: public key, message, signature.
VECTORS = [
    (
        "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a",
        "",
        "e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555fb8821590a33bacc61e39701cf9b46bd25bf5f0595bbe24655141438e7a100b",
    ),
    (
        "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c",
        "r",
        "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00",
    ),
]


def encoded(content: bytes) -> str:
    return base64.b64encode(content).decode()


@pytest.mark.parametrize(("key", "text", "signature"), VECTORS)
def test_the_vectors_of_the_rfc_hold_and_no_bit_of_them_may_change(key: str, text: str, signature: str) -> None:
    parts = [bytes.fromhex(key), bytes.fromhex(signature)]
    assert is_signed(encoded(parts[0]), text, encoded(parts[1]))
    assert not is_signed(encoded(parts[0]), text + "?", encoded(parts[1]))
    for which, part in enumerate(parts):
        for bit in range(0, 8 * len(part), 5):
            changed = bytearray(part)
            changed[bit // 8] ^= 1 << bit % 8
            forged = [*parts[:which], bytes(changed), *parts[which + 1 :]]
            assert not is_signed(encoded(forged[0]), text, encoded(forged[1]))


def test_a_signature_has_no_second_form() -> None:
    key, text, signature = VECTORS[1]
    content = bytes.fromhex(signature)
    scalar = int.from_bytes(content[32:], "little") + ORDER
    assert scalar < 2**256
    other = content[:32] + scalar.to_bytes(32, "little")
    assert not is_signed(encoded(bytes.fromhex(key)), text, encoded(other))


@settings(max_examples=100, deadline=None)
@given(st.text(max_size=90), st.text(max_size=8), st.text(max_size=90))
def test_texts_that_are_no_key_or_no_signature_are_refused(key: str, text: str, signature: str) -> None:
    assert not is_signed(key, text, signature)
    assert not is_signed(encoded(bytes.fromhex(VECTORS[0][0])), "\ud800", signature)
