#!/usr/bin/env bash
# Tests in lanes: processes of which one more runs at a time than there are cores, because some of them mostly wait for
# processes that they start and kill. A lane's words are shown when it has ended. The lanes that compute kernels begin,
# and those that take the kernels from them (tests/support/kernels.py) come late.
#   scripts/test.sh            everything, beside the linters
#   scripts/test.sh check      single modules and documents, beside the linters: nothing that has to be installed
#   scripts/test.sh WORDS...   pytest with these
set -uo pipefail
export BIN=${BIN:-.venv/bin}
# Hundreds of processes start, and where this variable is set each compiles all that it imports anew: 2.5 s of processor
# time for a worker, in place of 0.9.
unset PYTHONDONTWRITEBYTECODE
# Lanes keep the cores busy. Threads of one and the same small computation would wait for each other, and do so by
# turning: a fifth of the processor time of training, of compiled kernels and of the rasteriser.
threads=(OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1)
said=$(mktemp -d)
trap 'rm -rf "$said"' EXIT
cores=$(nproc 2>/dev/null || echo 2)
worst=0
declare -A running=()
TIMEFORMAT='took %R s, %U s and %S s of the processors'

# Waits until a lane has ended, and shows what it said.
finish_one() {
    local ended status=0
    wait -n -p ended "${!running[@]}" || status=$?
    printf '==== lane %s ended with %s after %s s in all; it ' "${running[$ended]}" "$status" "$SECONDS"
    cat "$said/${running[$ended]}".{time,out}
    unset "running[$ended]"
    [ "$status" -eq 0 ] || worst=1
}

lane() { # name, command...
    [ "${#running[@]}" -le "$cores" ] || finish_one
    { time "${@:2}" > "$said/$1.out" 2>&1; } 2> "$said/$1.time" &
    running[$!]=$1
}

tests() { # name, pytest's words...
    lane "$1" env "${threads[@]}" "$BIN/pytest" --durations=10 -p no:cacheprovider "${@:2}"
}

integration() { # of tests/integration, without test_ and .py
    printf 'tests/integration/test_%s.py\n' "$@"
}

browsers=(compare_browser dashboard_browser view_window web_build web_client web_three web_examples)
computing=(build cli_bench gpu_benchmark labeller_benchmark predictors_benchmark retrain stress_gl zink)
deployed=(deploy_compose deploy_images deploy_k8s deploy_run)

everything() {
    local apart
    mapfile -t apart < <(integration "${browsers[@]}" "${computing[@]}" "${deployed[@]}")
    lane lint make --no-print-directory lint
    tests differential tests/differential
    tests chaos tests/chaos --ignore=tests/chaos/test_builds.py
    tests services tests/unit/services tests/unit/diaphane tests/unit/client
    mapfile -t found < <(integration "${computing[@]}") && tests computing "${found[@]}"
    tests modules tests/unit tests/property tests/docs --ignore=tests/unit/{services,diaphane,client}
    tests integration tests/integration "${apart[@]/#/--ignore=}"
    mapfile -t found < <(integration "${browsers[@]}") && tests browsers "${found[@]}" tests/golden
    mapfile -t found < <(integration "${deployed[@]}") && tests deployed "${found[@]}"
    tests attacks tests/attacks tests/chaos/test_builds.py
}

check() {
    local quick=(-m "not installed and not dear")
    lane lint make --no-print-directory lint
    tests services "${quick[@]}" tests/unit/services tests/unit/diaphane
    tests modules "${quick[@]}" tests/unit tests/docs --ignore=tests/unit/{services,diaphane}
}

case "${1:-}" in
    "") everything ;;
    check) check ;;
    *) exec "$BIN/pytest" "$@" ;;
esac
while [ "${#running[@]}" -gt 0 ]; do finish_one; done
exit "$worst"
