#!/usr/bin/env bash
# All tests, two sets of them at once, each of which uses one core: those of single modules beside those of the renderer
# and the engine's kills; then, of tests/integration, those that compute themselves beside those that wait for processes
# that they start and kill. With arguments: pytest with these.
set -uo pipefail
pytest="${BIN:-.venv/bin}/pytest"
if [ "$#" -gt 0 ]; then
    exec "$pytest" "$@"
fi
said=$(mktemp)
trap 'rm -f "$said"' EXIT
worst=0

# Runs tests beside the next ones, until `join` shows what they said.
beside() {
    "$pytest" --durations=15 -p no:cacheprovider "$@" > "$said" 2>&1 &
}

join() {
    wait "$!" || worst=$?
    cat "$said"
}

computing=(tests/integration/test_{build,cli,cli_bench,cli_remote,cli_render,cli_view,retrain,stress_gl,web_client,zink}.py)
computing+=(tests/integration/test_{gpu_benchmark,labeller_benchmark,predictors_benchmark,view_window,web_build}.py)

beside tests/unit tests/property
"$pytest" --durations=15 tests/attacks tests/chaos tests/differential tests/docs tests/golden || worst=$?
join
beside "${computing[@]}"
"$pytest" --durations=15 tests/integration "${computing[@]/#/--ignore=}" || worst=$?
join
exit "$worst"
