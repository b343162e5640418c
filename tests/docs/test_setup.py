"""What `make setup` tells uv of where packages come from."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

COMMON = Path(__file__).resolve().parents[2] / "scripts" / "common.sh"


def uv_settings(*listed: str) -> dict[str, str]:
    """The variables for uv that follow from lines of `pip config list`."""
    text = "".join(f"{line}\n" for line in listed)
    script = ["bash", "-euo", "pipefail", "-c", '. "$1"; uv_settings', "bash", str(COMMON)]
    done = subprocess.run(script, input=text, capture_output=True, text=True, check=True)
    return dict(line.split("=", 1) for line in done.stdout.splitlines())


@pytest.mark.parametrize(
    ("listed", "expected"),
    [
        ((), {}),
        (("global.timeout='5'",), {}),
        (("global.index-url='https://u:p@host/simple?a=b'",), {"UV_DEFAULT_INDEX": "https://u:p@host/simple?a=b"}),
        (("global.extra-index-url='\\nhttps://a/s\\nhttps://b/s'",), {"UV_INDEX": "https://a/s https://b/s"}),
        ((":env:.find-links='/wheels /more'",), {"UV_FIND_LINKS": "/wheels,/more"}),
        (("global.trusted-host='a b'", "global.cert='/c.crt'"), {"UV_INSECURE_HOST": "a b", "SSL_CERT_FILE": "/c.crt"}),
    ],
)
def test_uv_takes_packages_from_where_pip_does(listed: tuple[str, ...], expected: dict[str, str]) -> None:
    assert uv_settings(*listed) == expected


def test_the_environment_comes_before_the_files_and_a_command_before_all_commands() -> None:
    named = {
        section: f"{section}.index-url='https://{section.strip(':')}/'" for section in (":env:", "global", "install")
    }
    assert uv_settings(*named.values()) == {"UV_DEFAULT_INDEX": "https://env/"}
    assert uv_settings(named["global"], named["install"]) == {"UV_DEFAULT_INDEX": "https://install/"}
