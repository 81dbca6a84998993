#!/usr/bin/env bash
# Installs the packages of deploy/packages.txt that this machine lacks.
# Usage: install-packages.sh [build|run|test|boot]... The default is build.
# It asks no questions. It prints nothing if no package is missing; otherwise it needs root or sudo.
# Exit codes: 0 all packages are installed, 1 the installation failed, 2 wrong usage.
set -euo pipefail

list="$(dirname "${BASH_SOURCE[0]}")/packages.txt"
attempts=${CAIRN_APT_ATTEMPTS:-5}       # Each attempt waits up to 120 s for the lock of another apt.
retry_pause_s=${CAIRN_APT_PAUSE_S:-10}

fail() { echo "install-packages: $*" >&2; exit 1; }

if [ $# -eq 0 ]; then set -- build; fi
for section in "$@"; do
  if ! grep -qxF "[$section]" "$list"; then
    echo "install-packages: no section '$section' in $list; it has: $(sed -n 's/^\[\(.*\)\]$/\1/p' "$list" | xargs)" >&2
    exit 2
  fi
done

# The lines of the requested sections, with alternatives as `a|b`.
wanted=$(awk -v sections=" $* " '/^\[/ { gsub(/[][]/, ""); on = index(sections, " " $0 " "); next }
                                 on && !/^(#|$)/ { gsub(/[ \t]/, ""); print }' "$list" | sort -u)

command -v dpkg-query >/dev/null ||
  fail "this machine has no dpkg; install the packages of these sections of $list by hand: $*"

missing_lines() {
  local installed line
  installed=$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' 2>/dev/null | sed -n 's/^installed //p')
  for line in $wanted; do
    # A line with alternatives is complete if one of its packages is installed.
    grep -qxF "${line//|/$'\n'}" <<<"$installed" || echo "$line"
  done
}

missing=$(missing_lines)
[ -n "$missing" ] || exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
    as_root=(sudo -n env DEBIAN_FRONTEND=noninteractive)
  else
    fail "not root, and sudo does not work without a password. Run once: sudo $(printf %q "$(realpath "$0")") $*
It installs: ${missing//$'\n'/ }"
  fi
fi
export DEBIAN_FRONTEND=noninteractive
apt() { "${as_root[@]}" apt-get -qq -o DPkg::Lock::Timeout=120 -o Acquire::Retries=3 -o Dpkg::Use-Pty=0 "$@"; }

log=$(mktemp)
trap 'rm -f "$log"' EXIT
# The lock of `apt-get update` has no time-out of its own, so the whole command is repeated.
try() {
  local attempt
  for ((attempt = 1; attempt <= attempts; attempt++)); do
    if apt "$@" >"$log" 2>&1 </dev/null; then return 0; fi
    if [ "$attempt" -lt "$attempts" ]; then sleep "$retry_pause_s"; fi
  done
  cat "$log" >&2
  return 1
}

echo "installing: ${missing//$'\n'/ }"
# After a failed update the old package lists may still be usable, so try the installation anyway.
try update || echo "install-packages: the package lists could not be updated; trying with the old ones" >&2

names=()
for line in $missing; do
  chosen=
  for name in ${line//|/ }; do
    if apt-cache show --no-all-versions "$name" >/dev/null 2>&1; then chosen=$name; break; fi
  done
  # Without a network `apt-get update` succeeds with warnings, so show its output here.
  [ -n "$chosen" ] || { cat "$log" >&2; fail "no package source offers ${line//|/ or }"; }
  names+=("$chosen")
done
try install -y --no-install-recommends "${names[@]}" || fail "apt-get could not install: ${names[*]}"
still=$(missing_lines)
[ -z "$still" ] || fail "still missing after the installation: ${still//$'\n'/ }"
