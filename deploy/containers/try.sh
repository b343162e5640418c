#!/usr/bin/env bash
# Runs an image's steps in a bare Debian instead of an engine, then a command in the result as it would run in the
# container: as its user, without capabilities, the root read-only, /tmp and the volume in memory. Needs root and
# debootstrap.   try.sh ROLE FOLDER [COMMAND...]     default command: diaphane version
set -euo pipefail
# The mounts below are seen by this script only, and end with it; so do its processes.
[ -n "${DIAPHANE_TRY:-}" ] || DIAPHANE_TRY=1 exec unshare --mount --propagation private --pid --fork --kill-child "$0" "$@"

role=$1 folder=$2; shift 2
[ $# -gt 0 ] || set -- diaphane version
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source=$(cd "$here/../.." && pwd)

say() { printf 'try: %s\n' "$*" >&2; }

make_debian() {
    local mirror
    mirror=$(grep -rhoE 'https?://[^ ]+/debian/?( |$)' /etc/apt/sources.list /etc/apt/sources.list.d 2>/dev/null | head -1)
    say "Debian in $folder"
    debootstrap --variant=minbase --include=python3,python3-venv,ca-certificates bookworm "$folder" ${mirror:+"$mirror"} >&2
}

reach_servers() { # packages come from where this machine gets them
    local file
    for file in /etc/resolv.conf /etc/pip.conf /etc/ssl/certs/ca-certificates.crt; do
        [ ! -e "$file" ] || install -D -m 644 "$(realpath "$file")" "$folder$file"
    done
    rm -f "$folder/etc/apt/sources.list"
    cp -r /etc/apt/. "$folder/etc/apt/"
}

steps() {
    local inside=(chroot "$folder" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8)
    mkdir "$folder/source"
    cp -r "$here" "$folder/containers"
    (cd "$source" && cp -r pyproject.toml README.md LICENSE schemas renderer labeller trainer stress services "$folder/source")
    say "wheel.sh"
    "${inside[@]}" /containers/wheel.sh /source /wheels
    say "packages.sh $role"
    "${inside[@]}" /containers/packages.sh "$role"
    say "install.sh $role"
    "${inside[@]}" TORCH="${TORCH:-}" TORCH_INDEX="${TORCH_INDEX:-}" /containers/install.sh "$role" /wheels
    rm -rf "$folder/containers" "$folder/source" "$folder/wheels"
    say "the environment takes $(du -sh "$folder/opt/diaphane" | cut -f1)"
}

[ -e "$folder/etc/debian_version" ] || make_debian
mount --bind "$folder" "$folder"
mount -t proc proc "$folder/proc"
mount --rbind /dev "$folder/dev"
if [ ! -e "$folder/opt/diaphane" ]; then
    reach_servers
    steps
fi
# shellcheck disable=SC2016 # the Dockerfile's own variable
mapfile -t environment < <(sed -n '/ AS base$/,/^WORKDIR/p' "$here/Dockerfile" | grep -oE '[A-Z_]+=[^ \\]+' |
    sed 's|\$PATH|/usr/local/bin:/usr/bin:/bin|')
mount -t tmpfs tmpfs "$folder/tmp"
mount -t tmpfs -o uid=10001,gid=10001,mode=0750 tmpfs "$folder/var/lib/diaphane"
mount -o remount,bind,ro "$folder"
say "$*"
exec chroot "$folder" setpriv --reuid=10001 --regid=10001 --clear-groups --no-new-privs --bounding-set=-all \
    env -i "${environment[@]}" tini -- "$@"
