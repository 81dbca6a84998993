#!/usr/bin/env bash
# What deploy/demo.sh refuses before it does anything: demo_arguments_test.sh SOURCE_DIR
set -euo pipefail

demo=$1/deploy/demo.sh
world=$(mktemp -d)
trap 'rm -rf "$world"' EXIT
status=0
refuses() { # what, words it says, command
  local what=$1 words=$2 code=0
  shift 2
  "$@" >"$world/said" 2>&1 </dev/null || code=$?
  if [ "$code" -eq 2 ] && grep -q "$words" "$world/said"; then
    echo "ok: $what"
  else
    echo "FAILED: $what; it ended with $code and said: $(cat "$world/said")"
    status=1
  fi
}

mkdir "$world/mine"
echo dear >"$world/mine/letter"
refuses "a folder with files of another kind" "not from a demo" env DEMO_OUT="$world/mine" "$demo"
refuses "the same by a relative name" "not from a demo" env -C "$world" DEMO_OUT=mine "$demo"
[ "$(cat "$world/mine/letter")" = dear ] || { echo "FAILED: the letter is gone"; status=1; }
refuses "a log that is not there" "cannot read" "$demo" "$world/absent.log"
refuses "two logs" "A robot log given as LOG" "$demo" a b
exit $status
