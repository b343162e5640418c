"""A headless browser that sees two fonts only, and signed-in tabs of it that remember what went wrong."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
MILLISECONDS = 60_000
"""Of patience with a busy machine."""

FONTS = ("DejaVuSans.ttf", "DejaVuSans-Bold.ttf", "DejaVuSansMono.ttf", "DejaVuSansMono-Bold.ttf")
"""Those that the style sheet falls back to; Debian has them in `fonts-dejavu-core`."""
FONT_FOLDERS = (Path("/usr/share/fonts"), Path("/usr/local/share/fonts"))

WEBGPU = (
    *("--no-sandbox", "--ignore-gpu-blocklist", "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"),
    *("--enable-features=Vulkan", "--use-vulkan=swiftshader", "--use-angle=vulkan"),  # else no canvas can be shown
)
"""Flags with which it has WebGPU, in software."""

WEBGPU_AND_WEBGL = (*WEBGPU, "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""With which it has WebGL 2, too, and no canvas of WebGPU can be shown."""

SCHEMES = ("light", "dark")


def script(name: str) -> str:
    """A function that pages are looked at with, of a file beside the integration tests."""
    file = Path(__file__).parents[1] / "integration" / name
    return file.read_text(encoding="utf-8").rstrip("\n;")


_AUDITS = (script("dashboard_audit.js"), script("dashboard_reach.js"))
_DRAWN = "(() => { const theme = matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light';"
_DRAWN += " return [...document.querySelectorAll('.chart')].every((one) => one.dataset.theme === theme); })()"
"""Whether the charts of a page are drawn, in its colours."""
_FOCUS = script("dashboard_focus.js")

_FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-lcd-text", "--force-color-profile=srgb")
_FONTS_CONF = """<?xml version="1.0"?>
<!DOCTYPE fontconfig SYSTEM "fonts.dtd">
<fontconfig>
{folders}
<cachedir>{cache}</cachedir>
<selectfont><acceptfont>{accepted}</acceptfont><rejectfont><glob>*.*</glob></rejectfont></selectfont>
<alias><family>monospace</family><prefer><family>DejaVu Sans Mono</family></prefer></alias>
<alias><family>sans-serif</family><prefer><family>DejaVu Sans</family></prefer></alias>
<alias><family>system-ui</family><prefer><family>DejaVu Sans</family></prefer></alias>
<match target="font">
<edit name="antialias" mode="assign"><bool>true</bool></edit>
<edit name="hinting" mode="assign"><bool>false</bool></edit>
<edit name="rgba" mode="assign"><const>none</const></edit>
</match>
</fontconfig>
"""


def font_files() -> list[Path]:
    """The files of `FONTS` that are installed."""
    found = {path.name: path for folder in FONT_FOLDERS for path in folder.rglob("DejaVuSans*.ttf")}
    return [found[name] for name in FONTS if name in found]


@contextmanager
def browser(folder: Path, flags: Sequence[str] = _FLAGS) -> Iterator[Any]:
    """Chromium, whose pages look the same whichever fonts are installed beside `FONTS`.

    Args:
        folder: For what fontconfig is told, and its cache.
        flags: Of its command line.
    """
    from playwright.sync_api import sync_playwright

    told = folder / "fonts.conf"
    told.write_text(
        _FONTS_CONF.format(
            folders="".join(f"<dir>{path}</dir>" for path in FONT_FOLDERS),
            cache=folder / "fonts",
            accepted="".join(f"<glob>*/{name}</glob>" for name in FONTS),
        ),
        encoding="utf-8",
    )
    with sync_playwright() as tools:
        started = tools.chromium.launch(
            executable_path=CHROMIUM,
            args=list(flags),
            env={**os.environ, "FONTCONFIG_FILE": str(told)},
            timeout=MILLISECONDS,
        )
        try:
            yield started
        finally:
            started.close()


class Tab:
    """A tab that remembers what went wrong in it.

    Args:
        browser: The browser.
        url: Of the service.
        width: Of the window, CSS pixels.
        scheme: `light` or `dark`.
        more: Of the browser's context: `java_script_enabled`, `reduced_motion`, ...

    Attributes:
        scheme: Of its colours.
        faults: Errors and warnings of the console, uncaught errors, and requests that went elsewhere.
    """

    def __init__(self, browser: Any, url: str, width: int, scheme: str, **more: Any) -> None:
        size = {"width": width, "height": 900}
        self.context = browser.new_context(viewport=size, color_scheme=scheme, base_url=url, **more)
        self.page = self.context.new_page()
        self.page.set_default_timeout(MILLISECONDS)
        self.scheme, self.faults = scheme, list[str]()
        self.page.on(
            "console", lambda said: self.faults.append(said.text) if said.type in ("error", "warning") else None
        )
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("request", lambda sent: None if sent.url.startswith(url) else self.faults.append(sent.url))

    def sign_in(self, secret: str, to: str = "/") -> None:
        """Asks for a page, and signs in where that leads to."""
        self.page.goto(to)
        self.page.get_by_label("API key").fill(secret)
        self.page.keyboard.press("Enter")
        self.page.wait_for_url(f"**{to}")

    def address(self) -> dict[str, str]:
        """What the address says: the page's own, which Playwright's lags behind."""
        query: str = self.page.evaluate("location.search")
        return {name: values[0] for name, values in parse_qs(query.removeprefix("?")).items()}

    def until(self, expression: str) -> None:
        """Waits until an expression is true; the pages' policy forbids Playwright's own way."""
        end = time.monotonic() + MILLISECONDS / 1000
        while not self.page.evaluate(expression):
            assert time.monotonic() < end, expression
            self.page.wait_for_timeout(20)

    def audit(self) -> list[str]:
        """What is wrong with the page for those who cannot see it, or not well, in light and in dark, or too wide."""
        found: list[str] = []
        self.settle()
        for scheme in sorted(SCHEMES, key=lambda scheme: scheme != self.scheme):
            self.page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
            self.settle()
            found += [f"{scheme}: {fault}" for audit in _AUDITS for fault in self.page.evaluate(audit)]
        self.page.emulate_media(color_scheme=self.scheme, reduced_motion="no-preference")
        self.settle()
        wide = self.page.evaluate("document.scrollingElement.scrollWidth") - self.page.viewport_size["width"]
        return found + ([f"{wide} pixels too wide"] if wide > 0 else [])

    def walk(self) -> list[str]:
        """What is wrong with the way of the Tab key over the page, from what has the focus, or its top, to its end."""
        found: list[str] = []
        self.settle()
        begun = self.page.evaluate(_FOCUS)
        for place in range(begun["place"] + 1, begun["stops"]):
            self.page.keyboard.press("Tab")
            at = self.page.evaluate(_FOCUS)
            if at["place"] != place:
                return [*found, f"stop {at['place']} instead of {place}: {at['what']}"]
            if not (at["outlined"] and at["seen"] and at["contrast"] >= 3.0):
                found.append(f"the focus is not to be seen: {at}")
        return found

    def settle(self) -> None:
        """Waits until the page was laid out, and its scripts have seen how."""
        self.page.evaluate("() => new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
        self.until(_DRAWN)
