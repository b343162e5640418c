#!/usr/bin/env bash
# All tests in two processes: those of single modules beside the first of the others, which use one core. What is
# sensitive to time (tests/integration) comes when the former are through. With arguments: pytest with these.
set -uo pipefail
pytest="${BIN:-.venv/bin}/pytest"
if [ "$#" -gt 0 ]; then
    exec "$pytest" "$@"
fi
said=$(mktemp)
trap 'rm -f "$said"' EXIT
"$pytest" -p no:cacheprovider tests/unit tests/property > "$said" 2>&1 &
modules=$!
"$pytest" tests/attacks tests/chaos tests/differential tests/docs tests/golden tests/integration
others=$?
wait "$modules"
status=$?
cat "$said"
exit $((others > status ? others : status))
