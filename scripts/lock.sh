#!/usr/bin/env bash
# Writes requirements.lock: exact versions and sha256 hashes of everything, for every platform, free of index addresses.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
uv pip compile pyproject.toml --extra all --universal --python-version 3.11 --generate-hashes \
    --no-emit-index-url --no-emit-find-links --no-annotate --no-header --custom-compile-command "make lock" \
    --quiet --output-file requirements.lock
if grep -n '://' requirements.lock; then
    echo "lock: an address got into requirements.lock" >&2
    exit 1
fi
