#!/usr/bin/env bash
# Cairn as a service under a real systemd: boot_systemd.sh BUILD_DIR TREE
# Boots a small Debian (or Ubuntu: whatever this machine runs) in a container, with Cairn installed as deploy/README.md
# says, and runs service_checks.sh inside. TREE is that system's folder, made the first time (a minute and 600 MB) and only
# read afterwards. Needs root, debootstrap and systemd-nspawn (deploy/install-packages.sh boot) and, the first time, the
# package sources. Everything happens in mount, process and network namespaces of its own: when this ends, however it
# ends, nothing is left mounted or running. Exit code: 77 where it cannot be done.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=tests/deploy/empty_system.sh
. "$here/empty_system.sh"

if [ "${1:-}" != --inside ]; then
  [ $# -eq 2 ] || { sed -n '2,7s/^# \{0,1\}//p' "$0" >&2; exit 2; }
  build=$(realpath "$1") tree=$(realpath -m "$2")
  [ "$(id -u)" -eq 0 ] || skip "not root"
  for tool in debootstrap systemd-nspawn unshare; do command -v "$tool" >/dev/null || skip "no $tool on this machine"; done

  if empty_system "$tree" systemd,systemd-sysv,dbus; then
    cp -r "$here/../../deploy" "$tree/root/opt/deploy"
    chroot "$tree/root" /opt/deploy/install-packages.sh run
    touch "$tree/complete"
  fi
  exec unshare --mount --pid --net --ipc --uts --fork --kill-child --mount-proc --propagation private \
    "$0" --inside "$build" "$tree"
fi

build=$2 tree=$3
# Of this process alone, and gone with it: the container's root over the tree, and what nspawn keeps in /run.
enter_overlay "$tree"
# Twice: the second keeps the configuration that is there. (Not into a pipe: grep -q would end before cmake has said all.)
for _ in first second; do
  for component in server client web; do
    DESTDIR=/run/root cmake --install "$build" --component "$component" --prefix /usr/local
  done >/run/installed
done
grep -q 'cairnd.yaml.default$' /run/installed
run_booted "$here/service_checks.sh" 240
