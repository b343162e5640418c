"""The lock-free chain under every interleaving: the shaders' loops, one memory access at a time, in random turns.

Software drivers hide races, so the drawn pictures cannot show that the chain needs no lock; this can.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Generator
from random import Random

from hypothesis import given
from hypothesis import strategies as st

EMPTY = 0xFFFFFFFFFFFFFFFF
Steps = Generator[None, None, int | None]
"""A fragment's way: pauses before every access, and returns what falls out of the chain, if anything."""

keys = st.lists(st.tuples(st.integers(1, 4), st.integers(1, 3)), max_size=8)
slots = st.integers(0, 10)
randoms = st.randoms(use_true_random=False)


def passing(slot: list[int], key: int, is_before: Callable[[int, int], bool]) -> Steps:
    """kbuffer/chain.frag, and the loop over depths of chain_depth.frag: a read, then perhaps an atomic minimum."""
    for i in range(len(slot)):
        yield
        if is_before(slot[i], key):
            continue
        yield
        before, slot[i] = slot[i], min(slot[i], key)
        if before == EMPTY:
            return None
        key = max(key, before)
    return key


def has_nearer_depth(slot: int, key: int) -> bool:
    """What chain.frag asks of a slot: of its depth alone, since halves of 64 bits may be read apart."""
    return slot >> 32 < key >> 32


def colouring(depth: list[int], colour: list[int], z: int, word: int) -> Steps:
    """kbuffer/chain_colour.frag: a chain over the slots of the fragment's depth, by atomic minima alone."""
    for i in [i for i, at in enumerate(depth) if at == z]:
        yield
        before, colour[i] = colour[i], min(colour[i], word)
        if before == EMPTY:
            return None
        word = max(word, before)
    return word


def in_turns(ways: list[Steps], random: Random) -> list[int]:
    """Advance the fragments in random turns until all are through; what fell out."""
    fallen: list[int] = []
    while ways:
        way = random.choice(ways)
        try:
            next(way)
        except StopIteration as end:
            ways.remove(way)
            if end.value is not None:
                fallen.append(end.value)
    return fallen


def filled(kept: list[int], k: int) -> list[int]:
    return kept[:k] + [EMPTY] * (k - len(kept))


@given(keys, slots, randoms)
def test_one_pass_keeps_the_nearest_and_drops_the_others_once(
    fragments: list[tuple[int, int]], k: int, random: Random
) -> None:
    packed = sorted(z << 32 | word for z, word in fragments)
    slot = [EMPTY] * k
    fallen = in_turns([passing(slot, key, has_nearer_depth) for key in packed], random)
    assert slot == filled(packed, k)
    assert sorted(fallen) == packed[k:]


@given(keys, slots, randoms)
def test_two_passes_keep_the_same_and_drop_the_same(fragments: list[tuple[int, int]], k: int, random: Random) -> None:
    ordered = sorted(fragments)
    depth, colour = [EMPTY] * k, [EMPTY] * k
    in_turns([passing(depth, z, operator.le) for z, _ in fragments], random)
    assert depth == filled([z for z, _ in ordered], k)
    fallen = in_turns([colouring(depth, colour, z, word) for z, word in fragments], random)
    assert colour == filled([word for _, word in ordered], k)
    assert sorted(fallen) == sorted(word for _, word in ordered[k:])
