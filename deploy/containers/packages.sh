#!/usr/bin/env bash
# Installs a role's Debian packages and makes its user: packages.sh ROLE
set -euo pipefail
role=$1
# shellcheck source=deploy/containers/role.sh
. "$(dirname "${BASH_SOURCE[0]}")/role.sh"

packages=$(role_packages "$role")
export DEBIAN_FRONTEND=noninteractive
apt-get update -qq
# shellcheck disable=SC2086 # a list
apt-get install -y -qq --no-install-recommends $packages >/dev/null
rm -rf /var/lib/apt/lists/* /var/cache/apt/archives/*.deb

# Numbers, so that Kubernetes can see that the user is not root.
groupadd --gid 10001 diaphane
useradd --uid 10001 --gid 10001 --home-dir /var/lib/diaphane --no-create-home --shell /usr/sbin/nologin diaphane
install -d -o diaphane -g diaphane -m 0750 /var/lib/diaphane
