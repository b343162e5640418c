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

pip=(.venv/bin/python -m pip --quiet --disable-pip-version-check)

# In half of pip's time: it downloads side by side. The lock has it, so that its hash is checked as any other's.
with_uv() {
    local variable value
    while IFS='=' read -r variable value; do
        # What is set for uv itself stands.
        [ -n "${!variable:-}" ] || export "$variable=$value"
    done < <("${pip[@]}" config list | uv_settings)
    # As pip chooses between indexes: what is installed is settled by hashes.
    export UV_INDEX_STRATEGY=unsafe-best-match
    # A cache for this once, where files can be linked instead of copied; who uses uv anyway has one.
    command -v uv >/dev/null || export UV_CACHE_DIR=${UV_CACHE_DIR:-$PWD/.venv/cache}
    "${pip[@]}" install --no-cache-dir --no-compile --require-hashes --no-deps \
        -r <(awk '/^[^ ]/ { is_uv = /^uv==/ } is_uv' requirements.lock) &&
        .venv/bin/uv pip install --quiet --python .venv/bin/python --require-hashes -r requirements.lock &&
        .venv/bin/uv pip install --quiet --python .venv/bin/python --no-deps --no-build-isolation -e . &&
        rm -rf .venv/cache
}

# As uv does, without compiling all that is never imported, which takes a third of the time.
with_pip() {
    "${pip[@]}" install --no-cache-dir --no-compile --require-hashes -r requirements.lock
    "${pip[@]}" install --no-deps --no-build-isolation -e .
}

install_packages() {
    check_space
    say "installing the locked dependencies: about 6.5 GB on disk on Linux x86-64, 5.5 of them PyTorch with CUDA, which"
    say "training needs; all else works without it, below 1 GB: pip install '.[render]'"
    if ! with_uv; then
        say "uv could not install them, so pip does"
        make_venv
        with_pip
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
