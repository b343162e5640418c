# shellcheck shell=bash
# Sourced by the other scripts.

say() { printf 'setup: %s\n' "$*" >&2; }
die() { say "$*"; exit 1; }

find_python() {
    local candidate
    for candidate in ${PYTHON:-python3.11 python3.12 python3.13 python3}; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            command -v "$candidate"
            return
        fi
    done
    die "Python 3.11 or later is needed: install it, or name it with PYTHON=/path/to/python."
}

apt_install() { # why, packages...
    local why=$1 waiting=(); shift
    command -v apt-get >/dev/null || die "$why, and there is no apt-get here: install the equivalent of '$*' and run this again."
    local root=()
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || die "$why: run 'apt-get install $*' as root, then run this again."
        root=(sudo)
    fi
    say "$why: installing $* with apt-get."
    # setup.sh and setup-tests.sh run beside each other, and apt-get does not wait for another one's lists.
    command -v flock >/dev/null && waiting=(flock "${TMPDIR:-/tmp}/diaphane-apt-$(id -u).lock")
    "${waiting[@]}" "${root[@]}" env DEBIAN_FRONTEND=noninteractive sh -c \
        'apt-get update -qq && apt-get install -y -qq --no-install-recommends "$@" >/dev/null' sh "$@"
}

# What `pip config list` prints, on standard input -> the variables that make uv, which reads nothing of pip's, take
# packages from the same places, as NAME=VALUE. The environment comes before the files, [install] before [global].
uv_settings() {
    local listed option variable between section value words
    listed=$(cat)
    while read -r option variable between; do
        for section in :env: install global; do
            value=$(sed -nE "s/^$section\.$option='(.*)'\$/\1/p" <<<"$listed")
            [ -n "$value" ] || continue
            read -ra words <<<"${value//\\n/ }" # several stand on a line each
            (IFS=${between:- }; printf '%s=%s\n' "$variable" "${words[*]}")
            break
        done
    done <<'END'
index-url UV_DEFAULT_INDEX
extra-index-url UV_INDEX
find-links UV_FIND_LINKS ,
trusted-host UV_INSECURE_HOST
no-index UV_NO_INDEX
cert SSL_CERT_FILE
END
}
