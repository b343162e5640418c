#!/usr/bin/env bash
# Builds the site of the documents into build/site, in an environment of its own (build/docs-venv): the site needs
# nothing of Diaphane, whose docstrings are read and not imported, and Diaphane nothing of it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/common.sh
. scripts/common.sh

venv=build/docs-venv
stamp=$({ pwd; cat docs/requirements.lock; } | sha256sum | cut -d' ' -f1)
if [ "$(cat "$venv/.stamp" 2>/dev/null)" != "$stamp" ]; then
    say "making $venv"
    "$(find_python)" -m venv --clear "$venv"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile --require-hashes \
        -r docs/requirements.lock
    echo "$stamp" > "$venv/.stamp"
fi
NO_MKDOCS_2_WARNING=1 "$venv/bin/mkdocs" build --strict "$@"
say "the site is build/site/index.html"
