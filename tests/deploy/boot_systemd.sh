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
# The hierarchy that every systemd takes; where the machine has the older one, that stays as it is outside.
umount -R /sys/fs/cgroup 2>/dev/null || true
mount -t cgroup2 cgroup2 /sys/fs/cgroup

# Twice: the second keeps the configuration that is there. (Not into a pipe: grep -q would end before cmake has said all.)
for _ in first second; do DESTDIR=/run/root cmake --install "$build" --prefix /usr/local >/run/installed; done
grep -q 'cairnd.yaml.default$' /run/installed
cp "$here/service_checks.sh" /run/root/opt/
cat >/run/root/etc/systemd/system/checks.service <<'UNIT'
[Service]
Type=oneshot
TimeoutStartSec=240
ExecStart=/bin/bash /opt/service_checks.sh
StandardOutput=file:/opt/said
StandardError=inherit
ExecStopPost=/bin/sh -c 'journalctl -u cairnd -o short-monotonic >/opt/journal; systemctl exit "$$EXIT_STATUS"'
[Install]
WantedBy=multi-user.target
UNIT
mkdir -p /run/root/etc/systemd/system/multi-user.target.wants
ln -s ../checks.service /run/root/etc/systemd/system/multi-user.target.wants/
echo "booting; what the checks say follows"
code=0
# The time-out is for the container as a whole; the checks have their own.
SYSTEMD_NSPAWN_UNIFIED_HIERARCHY=1 timeout --kill-after=10 300 systemd-nspawn --boot --quiet --register=no --keep-unit \
  --private-network --console=pipe --directory=/run/root </dev/null >/run/console 2>&1 || code=$?
cat /run/root/opt/said || true  # Where it did not come to the checks there is none.
if [ "$code" -ne 0 ]; then
  echo "the container ended with $code; its console and the service's journal:"
  tail -n 20 /run/console
  grep -v ' config: ' /run/root/opt/journal | tail -n 100 || true
fi
exit "$code"
