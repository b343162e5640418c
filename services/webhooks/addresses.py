"""Where a webhook may lead: public addresses, and the networks that the settings name.

An administrator chooses the URL, but whoever runs the service decides what it reaches: without this, a webhook would be
a way to send requests to whatever listens beside the service (metadata of a cloud, databases, the service itself).

Rules:
- only `http` and `https`, without user and password;
- a name is resolved once, for one attempt; all its addresses must be allowed, and one of them is connected to: a name
  that means something else at the next question gains nothing;
- an address within another one (IPv4 in IPv6: mapped, 6to4, Teredo, NAT64) is judged as well.
"""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

from schemas.problem import Problem

Address = ipaddress.IPv4Address | ipaddress.IPv6Address
Network = ipaddress.IPv4Network | ipaddress.IPv6Network

_NAT64: Final = ipaddress.IPv6Network("64:ff9b::/96")
_COMPATIBLE: Final = ipaddress.IPv6Network("::/96")
_PORTS: Final = {"http": 80, "https": 443}


class Refused(Exception):
    """A webhook leads where it may not, or nowhere. Its text is for whoever looks at the delivery."""


@dataclass(frozen=True)
class Target:
    """The parts of a webhook's URL.

    Attributes:
        scheme: `http` or `https`.
        host: Name or address, without brackets.
        port: Port.
        place: Path and query.
        named: What the header `Host` says.
    """

    scheme: str
    host: str
    port: int
    place: str
    named: str


def parse(url: str) -> Target:
    """The parts of a URL.

    Raises:
        Problem: It is none that a webhook can have.
    """
    wrong = Problem(
        "The URL of the webhook is not valid.",
        "Give an http or https address in ASCII, without user, password and fragment: https://ci.example.org/diaphane.",
    )
    if not (url.isascii() and url.isprintable()) or " " in url or "\\" in url:
        raise wrong
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:
        raise wrong from None
    if parts.scheme not in _PORTS or not host or port == 0 or "@" in parts.netloc or "#" in url or "%" in host:
        raise wrong
    place = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
    named = f"[{host}]" if ":" in host else host
    return Target(parts.scheme, host, port or _PORTS[parts.scheme], place, named if port is None else f"{named}:{port}")


def networks_of(text: str) -> tuple[Network, ...]:
    """Networks, separated by commas.

    Raises:
        ValueError: One of them is none.
    """
    return tuple(ipaddress.ip_network(part.strip()) for part in text.split(",") if part.strip())


def is_public(address: Address) -> bool:
    """Whether an address is one of the internet's, for one host."""
    inner = _inner(address)
    if any(not is_public(one) for one in inner):
        return False
    if isinstance(address, ipaddress.IPv6Address):
        if address.ipv4_mapped is not None:
            return True  # as that address, which was judged
        if address.is_site_local or address in _COMPATIBLE:
            return False
    return address.is_global and not address.is_multicast


def is_allowed(address: Address, allowed: Sequence[Network]) -> bool:
    """Whether a webhook may be delivered to an address.

    Args:
        address: The address.
        allowed: Networks beside the public ones.
    """
    mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
    plain = mapped or address
    return is_public(address) or any(plain in network for network in allowed)


def resolve(target: Target, allowed: Sequence[Network]) -> list[str]:
    """The addresses of a target, all of which a webhook may be delivered to.

    Raises:
        Refused: There are none, or one of them is not allowed.
    """
    try:
        found = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        raise Refused("The name of the receiver cannot be resolved.") from None
    addresses = list(dict.fromkeys(str(entry[4][0]) for entry in found))
    if not all(is_allowed(ipaddress.ip_address(one), allowed) for one in addresses):
        raise Refused("The receiver has an address that is not public, and not in DIAPHANE_WEBHOOK_NETWORKS.")
    return addresses


def _inner(address: Address) -> list[ipaddress.IPv4Address]:
    """Addresses that an address leads on to."""
    if isinstance(address, ipaddress.IPv4Address):
        return []
    found = [address.ipv4_mapped, address.sixtofour, *(address.teredo or ())]
    if address in _NAT64:
        found.append(ipaddress.IPv4Address(int(address) & 0xFFFFFFFF))
    return [one for one in found if one is not None]
