#!/usr/bin/env bash
# Builds the wheel: wheel.sh SOURCE OUT
set -euo pipefail
source=$1 out=$2
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
pip=("$work/venv/bin/python" -m pip --disable-pip-version-check --no-cache-dir --quiet)
"${pip[@]}" install --require-hashes -r "$here/requirements-build.lock"
# A copy, because the build writes beside the sources.
cp -r "$source" "$work/source"
SOURCE_DATE_EPOCH=0 "${pip[@]}" wheel --no-deps --no-build-isolation --wheel-dir "$out" "$work/source"
