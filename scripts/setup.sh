#!/usr/bin/env bash
# Makes .venv with everything in requirements.lock, and sees to it that an OpenGL context can be made.
# Safe to run again: with an unchanged lock and pyproject.toml it does nothing.
# PYTHON names another interpreter (3.11 or later).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# shellcheck source=scripts/common.sh
. scripts/common.sh

make_venv() {
    local python version
    # It is emptied first, and through a link that would be another checkout's.
    [ ! -L .venv ] || die ".venv leads to $(readlink .venv), which is not installed for this checkout: remove the link, then run this again."
    python=$(find_python)
    if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
        version=$("$python" -c 'import sys; print(f"{sys.version_info.major}.{sys.version_info.minor}")')
        apt_install "Python's venv module is missing" "python$version-venv"
    fi
    say "making .venv with $python"
    "$python" -m venv --clear .venv
}

# PyTorch brings its CUDA libraries: 6.5 GB on Linux x86-64, and the files that they come in while they are unpacked.
# A disk that fills up half-way says so after minutes, and not what to do.
NEEDED_GB=11

check_space() {
    local free
    free=$(df --output=avail -BG . | tail -n 1 | tr -dc 0-9)
    [ "$free" -ge "$NEEDED_GB" ] ||
        die "about $NEEDED_GB GB are needed to install, and $free GB are free here: make room, then run this again."
}

install_packages() {
    check_space
    say "installing the locked dependencies (about 6.5 GB on disk on Linux x86-64)"
    if command -v uv >/dev/null; then
        uv pip install --quiet --python .venv/bin/python --require-hashes -r requirements.lock
        uv pip install --quiet --python .venv/bin/python --no-deps --no-build-isolation -e .
    else
        # As uv does, without compiling all that is never imported, which takes a third of the time.
        .venv/bin/python -m pip install --quiet --disable-pip-version-check --no-cache-dir --no-compile --require-hashes \
            -r requirements.lock
        .venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
    fi
}

context_works() { .venv/bin/python -m renderer.context; }

ensure_context() {
    context_works >/dev/null 2>&1 && return
    apt_install "no OpenGL context can be made" libegl1 libgl1 libgl1-mesa-dri libegl-mesa0
    context_works >&2 || die "an OpenGL context still cannot be made; the reason stands above."
}

# The folder is part of the stamp because a virtual environment does not survive being moved.
stamp=$({ pwd; cat requirements.lock pyproject.toml scripts/setup.sh scripts/common.sh; } | sha256sum | cut -d' ' -f1)
[ "$(cat .venv/.stamp 2>/dev/null)" = "$stamp" ] && exit 0
make_venv
install_packages
ensure_context
echo "$stamp" >.venv/.stamp
say "ready"
