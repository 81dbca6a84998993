#!/usr/bin/env bash
# The Debian packages in an empty system: packages_test.sh PACKAGES_DIR TREE
# Makes a small Debian (or Ubuntu: whatever this machine runs) in the folder TREE the first time, installs the packages
# there with apt, maps with a simulated robot, installs them again as an upgrade would, removes and purges them. The tree
# itself is only read: everything happens in an overlay that is gone when this ends. Prints how long it took until there
# was a map. Needs root, debootstrap and the package sources. Exit code: 77 where it cannot be done.
set -euo pipefail

# shellcheck source=tests/deploy/empty_system.sh
. "$(dirname "${BASH_SOURCE[0]}")/empty_system.sh"

if [ "${1:-}" != --inside ]; then
  [ $# -eq 2 ] || { sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 2; }
  packages=$(realpath "$1") tree=$(realpath -m "$2")
  [ "$(id -u)" -eq 0 ] || skip "not root"
  for tool in debootstrap ip unshare; do command -v "$tool" >/dev/null || skip "no $tool on this machine"; done
  if empty_system "$tree" ""; then touch "$tree/complete"; fi
  exec unshare --mount --pid --ipc --uts --fork --kill-child --mount-proc --propagation private \
    "$0" --inside "$packages" "$tree"
fi

packages=$2 tree=$3
enter_overlay "$tree"
mount -t proc proc /run/root/proc
mount --rbind /dev /run/root/dev
cp "$packages"/*.deb /run/root/opt/
mapfile -t debs < <(cd /run/root && printf '/%s\n' opt/cairn-*.deb)
export DEBIAN_FRONTEND=noninteractive

failed=0
check() { # what, command
  local what=$1
  shift
  if "$@"; then echo "ok: $what"; else echo "FAILED: $what"; failed=1; fi
}
inside() { chroot /run/root "$@" </dev/null; }
# Without a network but loopback.
alone() { unshare --net sh -c 'ip link set lo up && exec chroot /run/root "$@"' sh "$@" </dev/null; }
apt() { inside apt-get -qq -o Dpkg::Use-Pty=0 -o Acquire::Retries=3 "$@" >/run/apt 2>&1 || { tail -n 20 /run/apt; return 1; }; }
there() { [ -e "/run/root$1" ] || [ -L "/run/root$1" ]; }
gone() { ! there "$1"; }
# A robot maps for some seconds; then there is a picture.
cat >/run/root/opt/use.sh <<'USE'
set -eu
export XDG_STATE_HOME=/var/tmp/state
cairnd --config /etc/cairn/cairnd.yaml >/tmp/cairnd.log 2>&1 &
server=$!
trap 'kill "$server"; wait "$server"' EXIT
tries=0
until cairn ping --timeout 5; do tries=$((tries + 1)); [ "$tries" -lt 6 ]; done
cairn sim --world office --site hall --robots 1 --seconds 30 --rate 4
cairn status
cairn map export --site hall -o /tmp/hall.yaml
[ -s /tmp/hall.png ]
cairn-web --port 0 >/tmp/web.txt 2>&1 &
web=$!
trap 'kill "$web" "$server"; wait "$server"' EXIT
until grep -q '^cairn-web: http://' /tmp/web.txt; do kill -0 "$web"; sleep 0.1; done
USE

apt update
start=$SECONDS
check "apt installs the packages and all they need" apt install --no-install-recommends "${debs[@]}"
installed=$((SECONDS - start))
check "a robot maps, and the map can be exported" alone sh /opt/use.sh
echo "packages installed after ${installed} s, a map after $((SECONDS - start)) s"
for program in cairn cairnd cairn-offline cairn-calibrate cairn-web; do
  check "bash completes $program" inside test -s "/usr/share/bash-completion/completions/$program"
done
check "each program has a manual page" \
  inside sh -c 'for page in man8/cairnd.8 man1/cairn.1 man1/cairn-web.1 man1/cairn-offline.1 man1/cairn-calibrate.1; do test -s "/usr/share/man/$page.gz" || exit 1; done'
check "the service is enabled" there /etc/systemd/system/multi-user.target.wants/cairnd.service
[ "$failed" -eq 0 ] || exit 1  # Nothing below makes sense.
echo "wire: {domain: 5}" >/run/root/etc/cairn/cairnd.yaml
check "the packages can be installed again" apt install --reinstall "${debs[@]}"
check "and keep a changed configuration" grep -q 'domain: 5' /run/root/etc/cairn/cairnd.yaml
mkdir -p /run/root/var/lib/private/cairn
check "they can be removed" apt remove cairn-server cairn-client cairn-web
check "their programs are gone" gone /usr/bin/cairnd
check "the configuration and the maps are still there" eval 'there /etc/cairn/cairnd.yaml && there /var/lib/private/cairn'
check "they can be purged" apt purge cairn-server cairn-client cairn-web
check "nothing is left" eval 'gone /etc/cairn && gone /var/lib/private/cairn && gone /etc/systemd/system/multi-user.target.wants/cairnd.service'
exit $failed
