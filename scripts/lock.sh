#!/usr/bin/env bash
# Writes requirements.lock: exact versions and sha256 hashes of everything, for every platform, free of index addresses;
# and, with the same versions, one lock for each image and one for what builds the wheel (deploy/containers). The site of
# the documents has its own (docs/requirements.lock): nothing else is installed with it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
PATH=$PATH:$PWD/.venv/bin # has uv, where there is no other
# shellcheck source=deploy/containers/role.sh
. deploy/containers/role.sh

compile() { # lock, arguments of uv...
    local lock=$1; shift
    uv pip compile "$@" --universal --python-version 3.11 --generate-hashes \
        --no-emit-index-url --no-emit-find-links --no-annotate --no-header --custom-compile-command "make lock" \
        --quiet --output-file "$lock"
    if grep -n '://' "$lock"; then
        echo "lock: an address got into $lock" >&2
        exit 1
    fi
}

compile requirements.lock pyproject.toml --extra all
while read -r role _; do
    extras=$(role_extras "$role")
    # The universal lock constrains, so that an image has the versions that the tests ran with.
    # shellcheck disable=SC2046,SC2086 # lists
    compile "deploy/containers/requirements-$role.lock" pyproject.toml --constraints requirements.lock \
        $(printf -- '--extra=%s ' $extras)
done < <(grep -v '^#' deploy/containers/roles)
compile docs/requirements.lock --group pyproject.toml:docs
compile deploy/containers/requirements-build.lock --constraints requirements.lock - <<<"setuptools>=77"
