"""ed25519 verification (RFC 8032, section 5.1.7), so that a renderer needs no compiled library for it.

Only public values pass through here: how long it takes tells nobody anything. Rules beyond the equation:
- S is below the group's order, so that no signature has a second form;
- the y of a key is below p, so that no key has a second form;
- R is compared as bytes, so that it has one form as well.
"""

from __future__ import annotations

import hashlib
from typing import Final

Point = tuple[int, int, int, int]
"""Extended homogeneous coordinates X, Y, Z, T with x = X / Z, y = Y / Z, x y = T / Z (section 5.1.4)."""

_P: Final = 2**255 - 19
_ORDER: Final = 2**252 + 27742317777372353535851937790883648493
_D: Final = -121665 * pow(121666, -1, _P) % _P
_ROOT_OF_MINUS_ONE: Final = pow(2, (_P - 1) // 4, _P)
_NEUTRAL: Final[Point] = (0, 1, 1, 0)
_BYTES: Final = 32


def is_signed(public_key: bytes, message: bytes, signature: bytes) -> bool:
    """Whether a signature over a message is that of a public key.

    Args:
        public_key: 32 bytes.
        message: What was signed.
        signature: 64 bytes, R and S.
    """
    key = _decoded(public_key)
    scalar = int.from_bytes(signature[_BYTES:], "little")
    if key is None or len(signature) != 2 * _BYTES or scalar >= _ORDER:
        return False
    first = signature[:_BYTES]
    challenge = int.from_bytes(hashlib.sha512(first + public_key + message).digest(), "little") % _ORDER
    x, y, z, t = key
    return _encoded(_combined(scalar, _BASE, challenge, (-x, y, z, -t))) == first


def _add(first: Point, second: Point) -> Point:
    """The sum of two points, which may be the same (section 5.1.4)."""
    (x1, y1, z1, t1), (x2, y2, z2, t2) = first, second
    a, b = (y1 - x1) * (y2 - x2) % _P, (y1 + x1) * (y2 + x2) % _P
    c, d = 2 * _D * t1 * t2 % _P, 2 * z1 * z2 % _P
    e, f, g, h = b - a, d - c, d + c, b + a
    return e * f % _P, g * h % _P, f * g % _P, e * h % _P


def _combined(first: int, point: Point, second: int, other: Point) -> Point:
    """`first * point + second * other`: both by one row of doublings (Straus's method)."""
    addends = (None, point, other, _add(point, other))
    total = _NEUTRAL
    for bit in reversed(range(max(first.bit_length(), second.bit_length()))):
        total = _add(total, total)
        addend = addends[(first >> bit & 1) + 2 * (second >> bit & 1)]
        if addend is not None:
            total = _add(total, addend)
    return total


def _encoded(point: Point) -> bytes:
    x, y, z, _ = point
    inverse = pow(z, -1, _P)
    return (y * inverse % _P | (x * inverse % _P & 1) << 255).to_bytes(_BYTES, "little")


def _decoded(content: bytes) -> Point | None:
    """The point of 32 bytes; None if they are not one (section 5.1.3)."""
    number = int.from_bytes(content, "little")
    sign, y = number >> 255, number & (1 << 255) - 1
    if len(content) != _BYTES or y >= _P:
        return None
    square = (y * y - 1) * pow(_D * y * y + 1, -1, _P) % _P
    x = pow(square, (_P + 3) // 8, _P)
    if (x * x - square) % _P:
        x = x * _ROOT_OF_MINUS_ONE % _P
    if (x * x - square) % _P or (x == 0 and sign):
        return None
    if x & 1 != sign:
        x = _P - x
    return x, y, 1, x * y % _P


def _base() -> Point:
    point = _decoded((4 * pow(5, -1, _P) % _P).to_bytes(_BYTES, "little"))  # y = 4/5, x even
    assert point is not None
    return point


_BASE: Final = _base()
