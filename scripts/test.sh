#!/usr/bin/env bash
# All tests: those of single modules beside those of the renderer and the engine's kills, which use one core each; then
# tests/integration by itself, for it waits for processes that it kills and starts. With arguments: pytest with these.
set -uo pipefail
pytest="${BIN:-.venv/bin}/pytest"
if [ "$#" -gt 0 ]; then
    exec "$pytest" "$@"
fi
said=$(mktemp)
trap 'rm -f "$said"' EXIT
"$pytest" -p no:cacheprovider tests/unit tests/property > "$said" 2>&1 &
modules=$!
worst=0
"$pytest" tests/attacks tests/chaos tests/differential tests/docs tests/golden || worst=$?
wait "$modules" || worst=$?
cat "$said"
"$pytest" tests/integration || worst=$?
exit "$worst"
