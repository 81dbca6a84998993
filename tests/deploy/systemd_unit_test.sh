#!/usr/bin/env bash
# The systemd unit as systemd itself reads it: systemd_unit_test.sh BUILD_DIR
# The programs it names need not be installed: they are replaced by one that exists. Exit code 77: no systemd here.
set -euo pipefail

if ! command -v systemd-analyze >/dev/null; then echo "SKIPPED: no systemd-analyze on this machine"; exit 77; fi
world=$(mktemp -d)
trap 'rm -rf "$world"' EXIT
cmake --install "$1" --component server --prefix "$world/installed" >/dev/null
unit=$world/installed/lib/systemd/system/cairnd.service
sed -E 's|^(Exec[A-Za-z]*=)[^ ]+/cairnd|\1/bin/true|' "$unit" >"$world/cairnd.service"

status=0
check() { # what, command
  local what=$1
  shift
  if "$@"; then echo "ok: $what"; else echo "FAILED: $what"; status=1; fi
}

SYSTEMD_LOG_LEVEL=warning systemd-analyze verify --man=no "$world/cairnd.service" >"$world/said" 2>&1 || true
# Other units of the machine are not ours to judge.
check "systemd finds nothing wrong: $(grep cairnd "$world/said" || true)" [ -z "$(grep cairnd "$world/said")" ]
for line in Type=notify WatchdogSec= Restart=on-failure RestartPreventExitStatus=2 StateDirectory=cairn \
  KillSignal=SIGTERM; do
  check "the unit says $line" grep -q "^$line" "$unit"
done
check "UDP sockets stay allowed" grep -Eq '^RestrictAddressFamilies=.*\bAF_INET\b' "$unit"
if systemd-analyze --help | grep -q -- --offline; then  # Since systemd 250.
  check "exposure is at most 2.0" systemd-analyze security --no-pager --offline=true --threshold=20 "$world/cairnd.service"
fi
exit $status
