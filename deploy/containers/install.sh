#!/usr/bin/env bash
# Makes a role's environment, from its lock and the wheel alone: install.sh ROLE WHEELS [FOLDER]
#
# PyTorch is the build with CUDA that the lock names. For a smaller image without CUDA name another build:
#   TORCH="torch==VERSION+cpu --hash=sha256:..."   with the hash, so that it stays pinned
#   TORCH_INDEX=URL                                the index that has it
set -euo pipefail
role=$1 wheels=$2 folder=${3:-/opt/diaphane}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

requirements=$(mktemp)
trap 'rm -f "$requirements"' EXIT
cp "$here/requirements-$role.lock" "$requirements"

python3 -m venv "$folder"
pip=("$folder/bin/python" -m pip --disable-pip-version-check --no-cache-dir --quiet)
if [ "$role" = train ] && [ -n "${TORCH:-}" ]; then
    : "${TORCH_INDEX:?TORCH is set, so TORCH_INDEX has to name the index that has it}"
    # An entry goes from its name to the next line that is not indented. PyTorch's CUDA libraries go with it.
    awk '/^[^ ]/ { drop = /^(torch|triton|nvidia-|cuda-)/ } !drop' "$here/requirements-$role.lock" >"$requirements"
    "${pip[@]}" install --require-hashes --no-deps --index-url "$TORCH_INDEX" -r <(printf '%s\n' "$TORCH")
fi
"${pip[@]}" install --require-hashes --no-deps -r "$requirements"
"${pip[@]}" install --no-deps --no-index "$wheels"/*.whl

"$folder/bin/python" -m pip --disable-pip-version-check --quiet check
# Nothing is installed into an image that runs, and bytecode cannot be written there later.
"$folder/bin/python" -m pip uninstall --quiet --yes pip setuptools 2>/dev/null
"$folder/bin/python" -m compileall -q -j 0 "$folder/lib" >/dev/null || true
