#!/usr/bin/env bash
# The systemd units as systemd itself reads them: systemd_unit_test.sh BUILD_DIR
# The programs they name need not be installed: they are replaced by one that exists. Exit code 77: no systemd here.
set -euo pipefail

if ! command -v systemd-analyze >/dev/null; then echo "SKIPPED: no systemd-analyze on this machine"; exit 77; fi
world=$(mktemp -d)
trap 'rm -rf "$world"' EXIT
for component in server web; do cmake --install "$1" --component "$component" --prefix "$world/installed" >/dev/null; done
units=$world/installed/lib/systemd/system

status=0
check() { # what, command
  local what=$1
  shift
  if "$@"; then echo "ok: $what"; else echo "FAILED: $what"; status=1; fi
}

for name in cairnd cairn-web; do
  unit=$units/$name.service
  sed -E "s|^(Exec[A-Za-z]*=)[^ ]+/$name|\1/bin/true|" "$unit" >"$world/$name.service"
  SYSTEMD_LOG_LEVEL=warning systemd-analyze verify --man=no "$world/$name.service" >"$world/said" 2>&1 || true
  # Other units of the machine are not ours to judge.
  check "systemd finds nothing wrong: $(grep "$name" "$world/said" || true)" [ -z "$(grep "$name" "$world/said")" ]
  for line in Restart=on-failure RestartPreventExitStatus=2 KillSignal=SIGTERM; do
    check "the unit of $name says $line" grep -q "^$line" "$unit"
  done
  check "UDP sockets stay allowed" grep -Eq '^RestrictAddressFamilies=.*\bAF_INET\b' "$unit"
  if systemd-analyze --help | grep -q -- --offline; then  # Since systemd 250.
    check "exposure is at most 2.0" systemd-analyze security --no-pager --offline=true --threshold=20 "$world/$name.service"
  fi
done
for line in Type=notify WatchdogSec= StateDirectory=cairn UMask=0077 PrivateMounts=yes ProcSubset=pid \
  MemoryDenyWriteExecute=yes; do
  check "the unit of cairnd says $line" grep -q "^$line" "$units/cairnd.service"
done
exit $status
