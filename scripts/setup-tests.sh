#!/usr/bin/env bash
# Sees to what only the tests need: PostgreSQL's programs, with which the tests start servers of their own; Mesa's zink
# over its software Vulkan driver, on which they draw every technique a second time; the reference compiler of GLSL; a
# C and a C++ compiler for the header of deploy/client/c; a browser for the dashboard, and its font; a display
# without a screen, and hands for its keyboard and mouse, for the viewer; nginx, before two servers; strace, for what
# uploads make processes open. It needs nothing of setup.sh, and runs beside it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/common.sh
. scripts/common.sh

have_postgresql() {
    command -v initdb >/dev/null || compgen -G '/usr/lib/postgresql/*/bin/initdb' >/dev/null
}

# Its loader and its driver, as tests/support/drivers.py looks for them: there may be no .venv yet to make a context.
have_zink() {
    /sbin/ldconfig -p 2>/dev/null | grep -q 'libvulkan\.so\.1' &&
        [ -n "$(find /usr/share/vulkan /usr/local/share/vulkan /etc/vulkan -name 'lvp_icd*.json' -print -quit 2>/dev/null)" ]
}

have_font() {
    [ -n "$(find /usr/share/fonts /usr/local/share/fonts -name DejaVuSans.ttf -print -quit 2>/dev/null)" ]
}

# All at once: each installation reads the lists of all packages first.
missing=() why=''
needs() { # what is missing, packages...
    why+="${why:+, }$1"
    missing+=("${@:2}")
}

have() { command -v "$1" >/dev/null; }

have_postgresql || needs "PostgreSQL" postgresql
have_zink || needs "a Vulkan driver for zink" mesa-vulkan-drivers libvulkan1
have glslangValidator || needs "the reference compiler of GLSL" glslang-tools
have chromium || have google-chrome || needs "the browser of the dashboard's tests" chromium
have_font || needs "the font that the dashboard's pages fall back to" fonts-dejavu-core
{ have cc && have g++; } || needs "a C and a C++ compiler" gcc g++
{ have Xvfb && have xdotool; } || needs "the display of the viewer's tests" xvfb xdotool
have nginx || needs "the proxy before two servers" nginx-light
have strace || needs "the tracer of what processes open" strace
[ "${#missing[@]}" -eq 0 ] && exit 0

apt_install "tests miss $why" "${missing[@]}"
have_postgresql || die "PostgreSQL was installed, but there is no initdb in the PATH or /usr/lib/postgresql."
have_zink || say "the Vulkan driver was installed and is not found: what is drawn on zink will be skipped."
