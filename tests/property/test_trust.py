"""The rules of what a client believes: what was changed does not verify, and no history of replays leads back."""

from __future__ import annotations

import base64
import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from support.releases import SIGNER, STRANGER, Record, handover, pointer_to

from diaphane_client.errors import Refused
from diaphane_client.pointer import Pointer, parse_pointer, version_order
from diaphane_client.trust import SKEW_SECONDS, Question, Trust, advance, forget
from diaphane_client.trust_file import dump_trust, parse_trust
from services.registry.pointers import LIFETIME_SECONDS
from services.registry.signing import SigningKey

NOW = 1_780_000_000
SECOND = SigningKey(b"2" * 32)
RECORD: Record = {"name": "glass", "version": "1.2.0", "digest": "d" * 64}
GENUINE = pointer_to(RECORD, issued=NOW, serial=7, signer=SECOND, handovers=[handover(SIGNER, SECOND)])
ASKED = Question("http://registry.test", "glass", "champion")


def parsed(record: Record) -> Pointer:
    return parse_pointer(json.dumps(record).encode())


def texts(record: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Where the texts of an answer are."""
    if isinstance(record, str):
        return [path]
    inner = record.items() if isinstance(record, dict) else enumerate(record)
    return [found for key, value in inner for found in texts(value, (*path, key))]


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(texts(GENUINE)), st.data())
def test_an_answer_with_another_letter_anywhere_is_refused(path: tuple[Any, ...], data: st.DataObject) -> None:
    answer = json.loads(json.dumps(GENUINE))
    inner = answer
    for key in path[:-1]:
        inner = inner[key]
    text = inner[path[-1]]
    place = data.draw(st.integers(0, len(text) - 1))
    letter = data.draw(st.characters().filter(lambda letter: letter != text[place]))
    inner[path[-1]] = text[:place] + letter + text[place + 1 :]
    with pytest.raises(Refused):
        parsed(answer)


@settings(max_examples=200, deadline=None)
@given(
    st.binary(max_size=200)
    | st.integers(0, len(json.dumps(GENUINE)) - 1).map(lambda n: json.dumps(GENUINE)[:n].encode())
)
def test_bytes_that_are_no_answer_are_refused(content: bytes) -> None:
    with pytest.raises(Refused):
        parse_pointer(content)


@pytest.mark.parametrize("member", ["signature", "public_key"])
def test_a_key_and_a_signature_have_one_form(member: str) -> None:
    record = pointer_to(RECORD, issued=NOW)
    text = record[member].rstrip("=")
    other = chr(ord(text[-1]) + 1)  # only bits that base64 has too many of
    changed = {**record, member: text[:-1] + other + "=" * (len(record[member]) - len(text))}
    assert base64.b64decode(changed[member]) == base64.b64decode(record[member])
    assert parsed(record).serial
    with pytest.raises(Refused):
        parsed(changed)


CHANGES = st.one_of(
    st.tuples(st.just("name"), st.text(max_size=20).filter(lambda name: name != "glass")),
    st.tuples(st.just("selector"), st.sampled_from(["trial", "1.2.0", "", "Champion"])),
    st.tuples(st.just("serial"), st.integers(-5, 6) | st.booleans() | st.none() | st.floats()),
    st.tuples(st.just("issued"), st.integers(0, NOW - 10**6) | st.integers(NOW + SKEW_SECONDS + 1, 2**60)),
    st.tuples(st.just("expires"), st.integers(-5, NOW - SKEW_SECONDS) | st.integers(NOW + 86_401, 2**60)),
    st.tuples(st.just("version"), st.sampled_from(["1.1.0", "1.3.0", "1.2", "01.2.0", "", "../1.2.0", 7])),
    st.tuples(st.just("digest"), st.sampled_from(["e" * 64, "d" * 63, "D" * 64, None])),
)


@settings(max_examples=300, deadline=None)
@given(CHANGES)
def test_a_statement_that_says_something_else_is_refused_though_it_is_signed(change: tuple[str, Any]) -> None:
    trust = advance(Trust(), ASKED, parsed(GENUINE), NOW)
    said = {**json.loads(GENUINE["statement"]), change[0]: change[1]}
    text = json.dumps(said, allow_nan=True)
    with pytest.raises(Refused):
        advance(trust, ASKED, parsed({**GENUINE, "statement": text, "signature": SECOND.sign(text)}), NOW)


@settings(max_examples=50, deadline=None)
@given(st.sampled_from(["format", "name", "selector", "version", "digest", "serial", "issued", "expires"]))
def test_a_statement_with_a_member_too_few_or_too_many_is_refused(member: str) -> None:
    said = json.loads(GENUINE["statement"])
    for changed in ({**said, f"{member}s": said[member]}, {key: said[key] for key in said if key != member}):
        text = json.dumps(changed)
        with pytest.raises(Refused):
            parsed({**GENUINE, "statement": text, "signature": SECOND.sign(text)})


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_what_was_seen_is_kept_whole_or_not_read(data: st.DataObject) -> None:
    trust = forget(advance(Trust(), ASKED, parsed(GENUINE), NOW), "crystal")
    content = dump_trust(trust).encode()
    assert parse_trust(content) == trust
    with pytest.raises(ValueError, match=r"Expect|Unterminated|Invalid"):
        parse_trust(content[: data.draw(st.integers(0, len(content) - 1))])


class Replays(RuleBasedStateMachine):
    """A server moves an alias and changes its key; whoever is in between answers with anything that it ever signed."""

    def __init__(self) -> None:
        super().__init__()
        self.now = float(NOW)
        self.serial = 0
        self.keys = [SIGNER]
        self.version = 0
        self.signed: list[Record] = []
        self.trust = Trust()
        self.believed: Pointer | None = None

    @initialize()
    def first(self) -> None:
        self.move(0)
        self.ask()

    @rule(version=st.integers(0, 3), step=st.integers(1, 1000))
    def move(self, version: int, step: int = 1) -> None:
        """Also back to a version that it was before."""
        self.version, self.serial = version, self.serial + step

    @rule(seconds=st.sampled_from([1.0, 60.0, 600.0, 3000.0, 1e6]))
    def wait(self, seconds: float) -> None:
        self.now += seconds

    @precondition(lambda self: len(self.keys) < 5)
    @rule()
    def hand_over(self) -> None:
        self.keys.append(SigningKey(bytes([len(self.keys)]) * 32))

    @rule()
    def ask(self) -> None:
        """The server itself answers: that is always believed."""
        row = [handover(old, new) for old, new in zip(self.keys, self.keys[1:], strict=False)]
        record = {"name": "glass", "version": f"1.{self.version}.0", "digest": f"{self.version:064x}"}
        answer = pointer_to(record, serial=self.serial, issued=self.now, signer=self.keys[-1], handovers=row)
        self.signed.append(answer)
        self.believe(answer)
        assert self.believed is not None
        assert self.believed.version == record["version"]

    @precondition(lambda self: len(self.keys) > 1)
    @rule(data=st.data(), version=st.integers(0, 3))
    def steal(self, data: st.DataObject, version: int) -> None:
        """A key that was handed over, in other hands; and one that never was anybody's."""
        record = {"name": "glass", "version": f"1.{version}.0", "digest": f"{version:064x}"}
        stolen = data.draw(st.sampled_from(self.keys[:-1]))
        at = {"serial": self.serial + 1, "issued": self.now}
        believed = self.believed and self.believed.public_key
        if believed == self.keys[-1].public_key:
            for forged in (
                pointer_to(record, signer=stolen, **at),
                pointer_to(record, signer=STRANGER, handovers=[handover(stolen, STRANGER)], **at),
            ):
                with pytest.raises(Refused):
                    self.believe(forged)

    @rule(data=st.data())
    def replay(self, data: st.DataObject) -> None:
        before = self.believed
        answer = data.draw(st.sampled_from(self.signed))
        pointer = parsed(answer)
        try:
            self.believe(answer)
        except Refused:
            assert self.trust.names["glass"] is not None
            return
        assert pointer.expires + SKEW_SECONDS > self.now
        assert before is not None
        assert pointer.serial >= before.serial
        assert set(before.keys) <= set(pointer.keys)

    @rule()
    def restart(self) -> None:
        self.trust = parse_trust(dump_trust(self.trust).encode())

    @invariant()
    def keeps_the_highest(self) -> None:
        seen = self.trust.names.get("glass")
        if seen and self.believed:
            assert seen.marks["champion"].serial == self.believed.serial
            assert version_order(seen.highest) >= version_order(self.believed.version)

    def believe(self, answer: Record) -> None:
        pointer = parsed(answer)
        self.trust = advance(self.trust, ASKED, pointer, self.now)
        self.believed = pointer


Replays.TestCase.settings = settings(max_examples=60, stateful_step_count=25, deadline=None)
TestReplays = Replays.TestCase


def test_the_same_answer_is_believed_until_it_expires_and_changes_nothing() -> None:
    trust = advance(Trust(), ASKED, parsed(GENUINE), NOW)
    last = NOW + LIFETIME_SECONDS + SKEW_SECONDS - 1
    assert advance(trust, ASKED, parsed(GENUINE), last) is trust
    with pytest.raises(Refused):
        advance(trust, ASKED, parsed(GENUINE), last + 1)
