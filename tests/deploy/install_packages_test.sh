#!/usr/bin/env bash
# deploy/install-packages.sh in a small world of its own: a list, a package database and an apt-get that only writes down
# what it was asked: install_packages_test.sh SOURCE_DIR
set -euo pipefail

source_dir=$1
world=$(mktemp -d)
trap 'rm -rf "$world"' EXIT
mkdir -p "$world/deploy" "$world/bin"
cp "$source_dir/deploy/install-packages.sh" "$world/deploy/"

cat >"$world/deploy/packages.txt" <<'LIST'
# a comment
[build]
compiler
# another
library-2 | library-1

[test]
checker
LIST

fake() { printf '#!/bin/bash\n%s\n' "$2" >"$world/bin/$1"; chmod +x "$world/bin/$1"; }
# shellcheck disable=SC2016  # The fakes expand their variables themselves.
{
fake dpkg-query 'sed "s/^/installed /" "$WORLD/installed"; echo "config-files checker"'
fake apt-cache 'grep -qxF "${@: -1}" "$WORLD/offered"'
fake id 'echo "${WORLD_UID:-0}"'
fake sudo 'exit 1'
fake apt-get 'echo "$*" >>"$WORLD/asked"
[ "$DEBIAN_FRONTEND" = noninteractive ] || exit 9
if [ -s "$WORLD/locked" ]; then sed -i 1d "$WORLD/locked"; echo "could not get lock" >&2; exit 100; fi
case " $* " in *" update "*) echo "W: no route to update" ;; *" install "*) printf "%s\n" "$@" | sed -n "/^--no-install/,\$p" | tail -n +2 >>"$WORLD/installed" ;; esac'
}
export WORLD=$world

status=0
install() { # expected exit code, arguments
  local expected=$1 code=0
  shift
  : >"$world/asked"
  PATH="$world/bin:$PATH" CAIRN_APT_PAUSE_S=0 "$world/deploy/install-packages.sh" "$@" >"$world/said" 2>&1 </dev/null || code=$?
  expect "exit code $expected of: install-packages.sh $*" [ "$code" -eq "$expected" ]
}
expect() { # what, command
  local what=$1
  shift
  if "$@"; then echo "ok: $what"; else echo "FAILED: $what; it said: $(cat "$world/said")"; status=1; fi
}
reset() { printf '%s\n' "$1" >"$world/installed"; printf '%s\n' "$2" >"$world/offered"; : >"$world/locked"; }

reset $'compiler\nlibrary-1' ''
install 0
expect "nothing missing asks apt-get nothing" [ ! -s "$world/asked" ]
expect "nothing missing says nothing" [ ! -s "$world/said" ]

reset 'compiler' $'library-1\nchecker'
install 0 build test
expect "installs what is missing, the alternative on offer, and nothing else" \
  grep -q -- '-y --no-install-recommends checker library-1$' "$world/asked"

reset 'compiler' 'library-2'
install 0
expect "other sections are left alone" grep -q -- '--no-install-recommends library-2$' "$world/asked"

reset 'compiler' 'library-2'
printf 'x\nx\nx\n' >"$world/locked"
install 0
expect "a locked package database is tried again" [ "$(wc -l <"$world/asked")" -eq 5 ]

reset 'compiler' ''
install 1
expect "a package no source offers is named" grep -q 'library-2 or library-1' "$world/said"
# Without a network apt-get only warns, and the package lists are as empty as before.
expect "with what apt-get said of its sources" grep -q 'W: no route to update' "$world/said"

reset 'compiler' 'library-2'
WORLD_UID=1000 install 1
expect "neither root nor sudo is said in words" grep -q 'not root, and sudo does not work' "$world/said"
expect "and what to run" grep -q "sudo $world/deploy/install-packages.sh build" "$world/said"
expect "and what to install is named" grep -q 'library-2' "$world/said"

install 2 nothing
expect "an unknown section is a usage error that names the known ones" grep -q 'build test' "$world/said"

# The real list: one plain name or alternatives a line, nothing twice in a section. (A section is installed without the others.)
bad=$(grep -vE '^(#.*|\[(build|run|test|boot|containers|images|package)\]|[a-z0-9][a-z0-9.+-]+( \| [a-z0-9][a-z0-9.+-]+)*|)$' "$source_dir/deploy/packages.txt" || true)
expect "every line of packages.txt has a known form ($bad)" [ -z "$bad" ]
twice=$(awk '/^\[/ {section = $0; next} /^(#|$)/ {next} seen[section, $0]++ {print}' "$source_dir/deploy/packages.txt")
expect "no package is listed twice in a section ($twice)" [ -z "$twice" ]
exit $status
