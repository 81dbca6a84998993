# Sourced by the tests that need a system of their own.

skip() { echo "SKIPPED: $*"; exit 77; }

# Makes a small system like this machine's (Debian or Ubuntu) in TREE/root, unless it was completed there before:
# empty_system TREE PACKAGES, then `touch TREE/complete` when what the test adds is in it. Returns 1 where it is complete.
# A minute and 300 MB. PACKAGES: comma-separated, installed besides; may be empty.
empty_system() {
  local tree=$1 packages=$2 codename distribution components=main
  [ ! -e "$tree/complete" ] || return 1
  # shellcheck disable=SC1091
  read -r codename distribution < <(. /etc/os-release && echo "$VERSION_CODENAME $ID")
  [ "$distribution" != ubuntu ] || components=main,universe
  rm -rf "$tree"
  mkdir -p "$tree"
  echo "making $tree"
  debootstrap --variant=minbase --components="$components" ${packages:+--include="$packages"} "$codename" "$tree/root" \
    >"$tree/log" 2>&1 || skip "debootstrap failed: $(tail -n 1 "$tree/log")"
}

# An overlay over TREE/root at /run/root, gone with the mount namespace of the caller.
enter_overlay() {
  local tree=$1
  mount -t tmpfs -o mode=755 tmpfs /run
  mkdir -p /run/over/{upper,work} /run/root
  mount -t overlay -o "lowerdir=$tree/root,upperdir=/run/over/upper,workdir=/run/over/work" overlay /run/root
}

# Boots the system at /run/root (a systemd is in it), runs the script CHECKS there, shows what it says, and ends the system:
# run_booted CHECKS SECONDS. Returns the exit code of CHECKS; if it failed, the system's console and the journal of the
# services are shown as well. The caller has mount, process and further namespaces of its own.
run_booted() {
  local checks=$1 seconds=$2 code=0
  # The hierarchy that every systemd takes; where the machine has the older one, that stays as it is outside.
  umount -R /sys/fs/cgroup 2>/dev/null || true
  mount -t cgroup2 cgroup2 /sys/fs/cgroup
  cp "$checks" /run/root/opt/checks.sh
  cat >/run/root/etc/systemd/system/checks.service <<UNIT
[Service]
Type=oneshot
TimeoutStartSec=$seconds
ExecStart=/bin/bash /opt/checks.sh
StandardOutput=file:/opt/said
StandardError=inherit
ExecStopPost=/bin/sh -c 'journalctl -u cairnd -u cairn-web -o short-monotonic >/opt/journal; systemctl exit "\$\$EXIT_STATUS"'
[Install]
WantedBy=multi-user.target
UNIT
  mkdir -p /run/root/etc/systemd/system/multi-user.target.wants
  ln -s ../checks.service /run/root/etc/systemd/system/multi-user.target.wants/
  echo "booting; what the checks say follows"
  # The time-out is for the container as a whole; the checks have their own.
  SYSTEMD_NSPAWN_UNIFIED_HIERARCHY=1 timeout --kill-after=10 $((seconds + 60)) systemd-nspawn --boot --quiet --register=no \
    --keep-unit --private-network --console=pipe --directory=/run/root </dev/null >/run/console 2>&1 || code=$?
  cat /run/root/opt/said || true  # Where it did not come to the checks there is none.
  if [ "$code" -ne 0 ]; then
    echo "the container ended with $code; its console and the journal of the services:"
    tail -n 20 /run/console
    grep -v ' config: ' /run/root/opt/journal | tail -n 100 || true
  fi
  return "$code"
}
