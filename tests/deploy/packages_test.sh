#!/usr/bin/env bash
# The Debian packages in an empty system: packages_test.sh PACKAGES_DIR TREE
# Makes a small Debian (or Ubuntu: whatever this machine runs) in the folder TREE the first time, installs an older version
# of the packages there with apt (the same ones with a lower number), compiles the example of libcairn-dev with nothing but
# a compiler and what the package depends on, and boots the system. There package_checks.sh uses, upgrades, removes and
# purges the packages. The tree itself is only read: everything happens in an overlay that is gone when this ends. Needs
# root, debootstrap, systemd-nspawn and the package sources. Exit code: 77 where it cannot be done.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=tests/deploy/empty_system.sh
. "$here/empty_system.sh"

if [ "${1:-}" != --inside ]; then
  [ $# -eq 2 ] || { sed -n '2,7s/^# \{0,1\}//p' "$0" >&2; exit 2; }
  packages=$(realpath "$1") tree=$(realpath -m "$2")
  [ "$(id -u)" -eq 0 ] || skip "not root"
  for tool in debootstrap systemd-nspawn unshare; do command -v "$tool" >/dev/null || skip "no $tool on this machine"; done
  if empty_system "$tree" ""; then touch "$tree/complete"; fi
  exec unshare --mount --pid --ipc --uts --fork --kill-child --mount-proc --propagation private \
    "$0" --inside "$packages" "$tree"
fi

packages=$2 tree=$3
enter_overlay "$tree"
mount -t proc proc /run/root/proc
mount --rbind /dev /run/root/dev
export DEBIAN_FRONTEND=noninteractive

failed=0
check() { # what, command
  local what=$1
  shift
  if "$@"; then echo "ok: $what"; else echo "FAILED: $what"; failed=1; fi
}
inside() { chroot /run/root "$@" </dev/null; }
apt() { inside apt-get -qq -o Dpkg::Use-Pty=0 -o Acquire::Retries=3 "$@" >/run/apt 2>&1 || { tail -n 20 /run/apt; return 1; }; }
# Writes a package to /opt/old of the system, with a lower version than it has, and than that which it depends on has.
make_older() {
  rm -rf /run/unpacked
  dpkg-deb --raw-extract "$1" /run/unpacked
  sed -i -E 's/^Version: .*/&~older/; s/(libcairn[0-9.]+ \(= [^)]*)\)/\1~older)/' /run/unpacked/DEBIAN/control
  dpkg-deb --root-owner-group -Znone --build /run/unpacked /run/root/opt/old >/dev/null
}
compile_example() {
  inside sh -ec 'cmake -S /usr/share/doc/libcairn-dev/examples/robot -B /opt/robot && cmake --build /opt/robot' >/run/compiled 2>&1 ||
    { tail -n 30 /run/compiled; return 1; }
}

mkdir -p /run/root/opt/{old,new}
cp "$packages"/*.deb /run/root/opt/new/
for package in "$packages"/*.deb; do make_older "$package"; done
apt update
start=$SECONDS
mapfile -t debs < <(cd /run/root && printf '/%s\n' opt/old/cairn-*.deb)
check "apt installs the packages and all they need" apt install --no-install-recommends "${debs[@]}"
echo "packages installed after $((SECONDS - start)) s"
for program in cairn cairnd cairn-offline cairn-calibrate cairn-web; do
  check "bash completes $program" inside test -s "/usr/share/bash-completion/completions/$program"
done
check "each program has a manual page" \
  inside sh -c 'for page in man8/cairnd.8 man1/cairn.1 man1/cairn-replay.1 man1/cairn-web.1 man1/cairn-offline.1 man1/cairn-calibrate.1; do test -s "/usr/share/man/$page.gz" || exit 1; done'
check "with the options of a command" inside sh -c 'zgrep -q -- window /usr/share/man/man1/cairn-replay.1.gz'
cp "$here/named_pages.sh" /run/root/opt/
check "the pages that are named are there" inside bash /opt/named_pages.sh /
for service in cairnd cairn-web; do
  check "$service is enabled" inside test -L "/etc/systemd/system/multi-user.target.wants/$service.service"
done
mapfile -t debs < <(cd /run/root && printf '/%s\n' opt/old/libcairn*.deb)
check "apt installs the client library, a compiler, and a systemd to boot" \
  apt install --no-install-recommends cmake g++ make systemd systemd-sysv dbus "${debs[@]}"
check "the example of the client library compiles" compile_example
[ "$failed" -eq 0 ] || exit 1  # Nothing below makes sense.

umount --recursive --lazy /run/root/dev /run/root/proc
run_booted "$here/package_checks.sh" 240
