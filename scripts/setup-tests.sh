#!/usr/bin/env bash
# Sees to what only the tests need: PostgreSQL's programs, with which the tests start servers of their own; Mesa's zink
# over its software Vulkan driver, on which they draw every technique a second time; the reference compiler of GLSL; a
# C and a C++ compiler for the header of deploy/client/c; a browser for the dashboard, and its font; a display
# without a screen, and hands for its keyboard and mouse, for the viewer.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/common.sh
. scripts/common.sh

have_postgresql() {
    command -v initdb >/dev/null || compgen -G '/usr/lib/postgresql/*/bin/initdb' >/dev/null
}

have_zink() {
    GALLIUM_DRIVER=zink MESA_LOADER_DRIVER_OVERRIDE=zink LIBGL_ALWAYS_SOFTWARE=1 XDG_RUNTIME_DIR=${TMPDIR:-/tmp} \
        .venv/bin/python -m renderer.context 2>/dev/null | grep -q '^zink'
}

if ! have_postgresql; then
    apt_install "PostgreSQL is missing" postgresql
    have_postgresql || die "PostgreSQL was installed, but there is no initdb in the PATH or /usr/lib/postgresql."
fi
if ! have_zink; then
    apt_install "zink has no Vulkan driver" mesa-vulkan-drivers libvulkan1
    have_zink || say "zink still makes no OpenGL context: tests/integration/test_zink.py will fail."
fi
if ! command -v glslangValidator >/dev/null; then
    apt_install "the reference compiler of GLSL is missing" glslang-tools
fi
if ! command -v chromium >/dev/null && ! command -v google-chrome >/dev/null; then
    apt_install "the browser of the dashboard's tests is missing" chromium
fi
if [ -z "$(find /usr/share/fonts /usr/local/share/fonts -name DejaVuSans.ttf -print -quit 2>/dev/null)" ]; then
    apt_install "the font that the dashboard's pages fall back to is missing" fonts-dejavu-core
fi
if ! command -v cc >/dev/null || ! command -v g++ >/dev/null; then
    apt_install "a C and a C++ compiler are missing" gcc g++
fi
if ! command -v Xvfb >/dev/null || ! command -v xdotool >/dev/null; then
    apt_install "the display of the viewer's tests is missing" xvfb xdotool
fi
