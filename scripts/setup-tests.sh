#!/usr/bin/env bash
# Sees to what only the tests need: PostgreSQL's programs. The tests start servers of their own with them.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/common.sh
. scripts/common.sh

have_postgresql() {
    command -v initdb >/dev/null || compgen -G '/usr/lib/postgresql/*/bin/initdb' >/dev/null
}

have_postgresql && exit 0
apt_install "PostgreSQL is missing" postgresql
have_postgresql || die "PostgreSQL was installed, but there is no initdb in the PATH or /usr/lib/postgresql."
