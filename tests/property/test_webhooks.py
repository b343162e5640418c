"""Webhooks: what is signed is verified by another implementation, waits are bounded, no address inside is public."""

from __future__ import annotations

import ipaddress
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from standardwebhooks import Webhook, WebhookVerificationError

from schemas.problem import Problem
from services.webhooks import signature
from services.webhooks.addresses import is_allowed, is_public, networks_of, parse
from services.webhooks.schedule import Schedule

INSIDE = (
    *("0.0.0.0/8", "10.0.0.0/8", "100.64.0.0/10", "127.0.0.0/8", "169.254.0.0/16", "172.16.0.0/12", "192.168.0.0/16"),
    *("224.0.0.0/4", "240.0.0.0/4", "::/128", "::1/128", "fc00::/7", "fe80::/10", "fec0::/10", "ff00::/8"),
)
MESSAGE_IDS = st.from_regex(r"msg_[0-9a-f]{24}", fullmatch=True)


@st.composite
def addresses_inside(draw: st.DrawFn) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """An address that is nobody's on the internet, plain or within an address of IPv6."""
    network = ipaddress.ip_network(draw(st.sampled_from(INSIDE)))
    address = network[draw(st.integers(0, network.num_addresses - 1))]
    if isinstance(address, ipaddress.IPv6Address):
        return address
    number = int(address)
    forms = {
        "plain": number,
        "mapped": 0xFFFF << 32 | number,
        "compatible": number,
        "6to4": 0x2002 << 112 | number << 80 | 1,
        "nat64": int(ipaddress.IPv6Address("64:ff9b::")) | number,
        "teredo": 0x2001 << 112 | 0x08080808 << 64 | (number ^ 0xFFFFFFFF),
    }
    form = draw(st.sampled_from(sorted(forms)))
    return address if form == "plain" else ipaddress.IPv6Address(forms[form])


def test_the_specification_s_own_example() -> None:
    body = b'{"event_type":"ping","data":{"success":true}}'
    made = signature.sign("whsec_plJ3nmyCDGBKInavdOK15jsl", "msg_loFOjxBNrRLzqYUf", 1731705121, body)
    assert made == "v1,rAvfW3dJ/X/qxhsaXPOyyCGmRKsaKWcsNccKXlIktD0="


@given(message_id=MESSAGE_IDS, text=st.text(st.characters(codec="utf-8"), max_size=200), place=st.integers(0, 200))
def test_what_is_signed_is_verified_and_what_was_changed_is_not(message_id: str, text: str, place: int) -> None:
    body, other = text.encode(), f"{text[:place]} {text[place:]}".encode()
    secret, now = signature.new_secret(), int(time.time())
    made = signature.headers(secret, message_id, now, body)
    Webhook(secret).verify(body, made, json_parse=False)
    for wrong_body, wrong_headers, wrong_secret in (
        (other, made, secret),
        (body, {**made, "webhook-id": message_id[:-1]}, secret),
        (body, {**made, "webhook-timestamp": str(now - 1)}, secret),
        (body, made, signature.new_secret()),
    ):
        with pytest.raises(WebhookVerificationError):
            Webhook(wrong_secret).verify(wrong_body, wrong_headers, json_parse=False)


@given(
    attempts=st.integers(1, 30),
    first=st.floats(0.01, 100.0),
    factor=st.floats(1.0, 10.0),
    longest=st.floats(0.01, 1e5),
    jitter=st.floats(0.0, 0.5),
    chance=st.floats(0.0, 1.0, exclude_max=True),
)
def test_waits_grow_to_a_bound_and_end(
    attempts: int, first: float, factor: float, longest: float, jitter: float, chance: float
) -> None:
    schedule = Schedule(attempts, first, factor, longest, jitter)
    waits = [schedule.wait(attempt, chance) for attempt in range(1, attempts + 3)]
    tried = [wait for wait in waits if wait is not None]
    assert waits == [*tried, None, None, None]
    assert len(tried) == attempts - 1
    assert tried == sorted(tried)
    for number, wait in enumerate(tried):
        plain = min(longest, first * factor**number)
        assert plain * (1.0 - jitter) * 0.999 <= wait <= plain * (1.0 + jitter) * 1.001


def test_a_receiver_that_is_away_for_a_day_misses_nothing() -> None:
    schedule = Schedule()
    waits = [schedule.wait(attempt, 0.0) or 0.0 for attempt in range(1, schedule.attempts)]
    assert waits[0] < 10.0
    assert 86400.0 < sum(waits) < 2 * 86400.0


@given(addresses_inside())
def test_no_address_inside_is_public(address: ipaddress.IPv4Address | ipaddress.IPv6Address) -> None:
    assert not is_public(address)
    assert not is_allowed(address, networks_of("203.0.113.7"))


def test_what_is_public_or_named_is_allowed() -> None:
    for text in ("8.8.8.8", "2001:4860:4860::8888", "::ffff:8.8.8.8", "64:ff9b::808:808"):
        assert is_allowed(ipaddress.ip_address(text), ()), text
    named = networks_of("10.1.0.0/16, ::1")
    for text in ("10.1.2.3", "::ffff:10.1.2.3", "::1"):
        assert is_allowed(ipaddress.ip_address(text), named), text
    for text in ("10.2.0.1", "::ffff:10.2.0.1", "127.0.0.1", "::2"):
        assert not is_allowed(ipaddress.ip_address(text), named), text


@pytest.mark.parametrize(
    ("url", "host", "port", "place", "named"),
    [
        ("https://ci.example.org", "ci.example.org", 443, "/", "ci.example.org"),
        ("http://ci.example.org:8080/a/b?c=d", "ci.example.org", 8080, "/a/b?c=d", "ci.example.org:8080"),
        ("http://[::1]:80/x", "::1", 80, "/x", "[::1]:80"),
        ("HTTPS://CI.example.org/?q", "ci.example.org", 443, "/?q", "ci.example.org"),
    ],
)
def test_the_parts_of_a_url(url: str, host: str, port: int, place: str, named: str) -> None:
    target = parse(url)
    assert (target.host, target.port, target.place, target.named) == (host, port, place, named)


@pytest.mark.parametrize(
    "url",
    [
        *("", "ci.example.org", "ftp://ci.example.org/", "file:///etc/passwd", "https://", "https:///x", "http://[::1"),
        *("https://user@ci.example.org/", "https://user:secret@ci.example.org/", "https://@ci.example.org/"),
        *("https://ci.example.org/#x", "https://ci.example.org:0/", "https://ci.example.org:99999/"),
        *("https://ci.example.org/a b", "https://ci.example.org/\r\nX: y", "https://cï.example.org/"),
        *("https://ci.example.org\\@10.0.0.1/", "http://[fe80::1%25eth0]/", "https://ci.example.org/\t"),
    ],
)
def test_what_is_no_url_of_a_webhook(url: str) -> None:
    with pytest.raises(Problem, match="URL of the webhook"):
        parse(url)
