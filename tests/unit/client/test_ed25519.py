"""ed25519 of the client: the vectors of RFC 8032, and the same verdicts as OpenSSL's."""

from __future__ import annotations

import pytest
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from hypothesis import given, settings
from hypothesis import strategies as st

from diaphane_client.ed25519 import is_signed

ORDER = 2**252 + 27742317777372353535851937790883648493

# RFC 8032, section 7.1, tests 1 to 3: public key, message, signature.
VECTORS = [
    (
        "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a",
        "",
        "e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555fb8821590a33bacc61e39701cf9b46bd25bf5f0595bbe24655141438e7a100b",
    ),
    (
        "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c",
        "72",
        "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00",
    ),
    (
        "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025",
        "af82",
        "6291d657deec24024827e69c3abe01a30ce548a284743a445e3680d7db5ac3ac18ff9b538d16f290ae67f760984dc6594a7c15e9716ed28dc027beceea1ec40a",
    ),
]


def openssl(public_key: bytes, message: bytes, signature: bytes) -> bool:
    try:
        Ed25519PublicKey.from_public_bytes(public_key).verify(signature, message)
    except (InvalidSignature, ValueError):
        return False
    return True


@pytest.mark.parametrize(("key", "message", "signature"), VECTORS)
def test_the_vectors_of_the_rfc_hold_and_no_bit_of_them_may_change(key: str, message: str, signature: str) -> None:
    parts = [bytes.fromhex(part) for part in (key, message, signature)]
    assert is_signed(*parts)
    for which, part in enumerate(parts):
        for bit in range(0, 8 * len(part), 37):
            changed = bytearray(part)
            changed[bit // 8] ^= 1 << bit % 8
            assert not is_signed(*parts[:which], bytes(changed), *parts[which + 1 :])


@settings(max_examples=60, deadline=None)
@given(st.binary(min_size=32, max_size=32), st.binary(max_size=200), st.integers(0, 8 * 96 - 1))
def test_the_verdict_is_that_of_openssl(seed: bytes, message: bytes, bit: int) -> None:
    private = Ed25519PrivateKey.from_private_bytes(seed)
    key, signature = private.public_key().public_bytes_raw(), private.sign(message)
    assert is_signed(key, message, signature)
    changed = bytearray(key + signature)
    changed[bit // 8] ^= 1 << bit % 8
    forged = bytes(changed[:32]), message, bytes(changed[32:])
    assert is_signed(*forged) == openssl(*forged)
    assert not is_signed(key, message + b"?", signature)


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=70), st.binary(max_size=8), st.binary(max_size=70))
def test_bytes_that_are_no_key_or_no_signature_are_refused(key: bytes, message: bytes, signature: bytes) -> None:
    assert not is_signed(key, message, signature)


def test_a_signature_has_no_second_form() -> None:
    key, message, signature = (bytes.fromhex(part) for part in VECTORS[2])
    scalar = int.from_bytes(signature[32:], "little") + ORDER
    assert scalar < 2**256
    assert not is_signed(key, message, signature[:32] + scalar.to_bytes(32, "little"))
    p = 2**255 - 19
    for y in (p, p + 1, 2**255 - 1):  # y of a key that is not below p
        assert not is_signed(y.to_bytes(32, "little"), message, signature)
