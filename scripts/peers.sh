#!/usr/bin/env bash
# Makes .venv-peers with OpenUSD's Storm, for `diaphane storm compare`: the wheel bpy, which is under the GPL, ships it.
# It is an environment of its own: nothing here imports it, and its numpy is another one. PYTHON names an interpreter of
# version 3.11, the one that this bpy is built for. Safe to run again.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# shellcheck source=scripts/common.sh
. scripts/common.sh

python=${PYTHON:-python3.11}
"$python" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null ||
    die "Python 3.11 is needed: install it, or name it with PYTHON=/path/to/python."
[ -x .venv-peers/bin/python ] || "$python" -m venv .venv-peers
.venv-peers/bin/python -m pip install --quiet 'bpy==4.5.15' 'moderngl>=5.12'
say "Storm is in .venv-peers: diaphane storm compare SCENE"
