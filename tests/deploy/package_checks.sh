#!/usr/bin/env bash
# What a person does with the packages, run inside the system that packages_test.sh boots: an older version of them is
# installed, and nobody has started a service. Exit code 1 where anything is not as it should be.
set -u
export DEBIAN_FRONTEND=noninteractive

failed=0
check() { # what, command
  local what=$1
  shift
  if "$@"; then echo "ok: $what"; else echo "FAILED: $what"; failed=1; fi
}
# Within so many seconds, or not at all: eventually SECONDS COMMAND
eventually() {
  local deadline=$((SECONDS + $1))
  shift
  until "$@"; do [ "$SECONDS" -lt "$deadline" ] || return 1; sleep 0.1; done
}
# Another apt may run at the start of a system.
apt() {
  apt-get -qq -o Dpkg::Use-Pty=0 -o DPkg::Lock::Timeout=60 "$@" </dev/null >/run/apt 2>&1 ||
    { tail -n 20 /run/apt; return 1; }
}
runs() { systemctl is-active --quiet "$1"; }
pid() { systemctl show "$1" --property=MainPID --value; }
runs_anew() { runs "$1" && [ "$(pid "$1")" -ne "$2" ]; }
answers() { cairn ping --timeout 2s >/dev/null; }
page_answers() {
  {
    printf 'GET /readyz HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n' >&3 && head -n 1 <&3 | grep -q ' 200 '
  } 3<>/dev/tcp/127.0.0.1/8420
} 2>/dev/null
writes_map() { cairn map export --site office -o "/opt/$1.yaml" && [ -s "/opt/$1.png" ]; }
same_path() { cairn path robot1 -o /opt/after.tum && cmp /opt/before.tum /opt/after.tum; } >/dev/null 2>&1
drives() { /opt/robot/robot >/opt/poses || { tail -n 5 /opt/poses; return 1; }; }
kept() { [ -e /etc/cairn/cairnd.yaml ] && [ -n "$(ls /var/lib/private/cairn)" ]; }
mapfile -t all < <(cd /opt/new && printf '%s\n' *.deb | sed 's/_.*//')

check "the server of the packages runs" eventually 30 runs cairnd
check "it answers" eventually 10 answers
check "the page of the packages runs" eventually 30 runs cairn-web
check "it knows the server" eventually 20 page_answers
check "a robot maps" cairn sim --world office --site office --robots 1 --seconds 30 --rate 4
check "the map can be exported" writes_map before
echo "   $SECONDS s after the checks began"
check "so can the robot's path" cairn path robot1 -o /opt/before.tum
[ "$failed" -eq 0 ] || exit 1  # Nothing below makes sense.

# The upgrade.
echo "wire: {domain: 0}  # Changed here." >/etc/cairn/cairnd.yaml
server=$(pid cairnd) page=$(pid cairn-web)
check "newer packages can be installed" apt install --no-install-recommends /opt/new/*.deb
check "they are the newer ones" sh -c '! dpkg-query -W -f "\${Version}\n" "$@" | grep older' sh "${all[@]}"
check "the newer server runs" eventually 30 runs_anew cairnd "$server"
check "the newer page runs" eventually 30 runs_anew cairn-web "$page"
check "the changed configuration stays" grep -q 'Changed here' /etc/cairn/cairnd.yaml
check "the path of the robot is as before" eventually 30 same_path
check "and the map is there" eventually 30 writes_map after
check "a program that was compiled with the older library drives as a robot" drives
check "and gets poses: $(wc -l </opt/poses)" [ "$(wc -l </opt/poses)" -ge 20 ]

# The end.
check "the programs can be removed" apt remove cairn-server cairn-client cairn-web
check "nothing runs any more" sh -c '! systemctl is-active --quiet cairnd cairn-web'
check "they are gone" [ ! -e /usr/bin/cairnd ]
check "the configuration and the maps are still there" kept
check "everything can be purged" apt purge "${all[@]}"
find /etc /usr /var -xdev -name '*cairn*' ! -name Pitcairn | tee /run/left
check "nothing is left" [ ! -s /run/left ]
exit $failed
