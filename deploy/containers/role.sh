# shellcheck shell=bash
# Sourced: role_extras ROLE and role_packages ROLE print what stands in the table `roles`, separated by spaces.
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

_role() { # role, number of the first field, of the last
    awk -v role="$1" -v first="$2" -v last="$3" '
        $1 == role { found = 1; for (i = first; i <= last && i <= NF; i++) print $i }
        END { exit !found }' "$here/roles" | tr ',\n' '  ' || {
        echo "containers: there is no role $1 in $here/roles" >&2
        exit 1
    }
}
role_extras() { _role "$1" 2 2; }
role_packages() { _role "$1" 3 99; }
