#!/usr/bin/env bash
# What deploy/demo.sh refuses before it does anything, and how it ends: demo_arguments_test.sh SOURCE_DIR
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
refuses "an option that it does not have" "unknown option: --keeep" "$demo" --keeep
refuses "options before a log that is not there" "cannot read" "$demo" --secure --keep --open "$world/absent.log"
refuses "options after it" "cannot read" "$demo" "$world/absent.log" --no-keep
"$demo" --help >"$world/said" </dev/null || { echo "FAILED: --help ended with $?"; status=1; }
for word in --secure --keep --no-keep --open growing.png DEMO_SECONDS; do
  grep -q -e "$word" "$world/said" || { echo "FAILED: --help does not tell of $word"; status=1; }
done

# A whole run with programs that only pretend: the server and the page run until they are told to stop.
mkdir -p "$world/tree/deploy" "$world/tree/build/release/bin" "$world/path"
cp "$demo" "$world/tree/deploy/"
pretend() { # file, what it does
  printf '#!/bin/bash\n%s\n' "$2" >"$1"
  chmod +x "$1"
}
bin=$world/tree/build/release/bin
pretend "$world/tree/deploy/install-packages.sh" :
pretend "$world/tree/deploy/build-jobs.sh" "echo 1"
pretend "$world/path/cmake" :
pretend "$world/path/sleep" "exec /bin/sleep 0.02"
pretend "$world/path/xdg-open" "echo \"\$1\" >'$world/opened'"
stays="while :; do /bin/sleep 0.02; done"
# As in a real run, the robots drive until the server runs and the film has begun, and both are told to end after that.
# A program that is told so before it has set its trap would leave no output.
films="trap 'echo growing.png: 7 frames; exit 0' TERM; echo >'$world/filming'; $stays"
drives="until [ -s '$world/server' ] && [ -e '$world/filming' ]; do /bin/sleep 0.02; done; rm '$world/filming'"
pretend "$bin/cairn" "case \"\$*\" in
  eval*) echo '{\"ate_rmse_m\":0.01}' ;;
  *'map animate'*) $films ;;
  sim*) $drives ;;
esac"
pretend "$bin/cairnd" "trap 'exit 0' TERM; echo \$\$ >'$world/server'; $stays"
pretend "$bin/cairn-web" "trap 'exit 0' TERM; echo cairn-web: http://127.0.0.1:9/; $stays"
export PATH=$world/path:$PATH DEMO_OUT=$world/out
unset DISPLAY WAYLAND_DISPLAY
demo=$world/tree/deploy/demo.sh

check() { # what, condition as a command
  local what=$1
  shift
  if "$@"; then
    echo "ok: $what"
  else
    echo "FAILED: $what; the demo said: $(cat "$world/said")"
    status=1
  fi
}
said() { grep -q -e "$1" "$world/said"; }
silent() { ! said "$1"; }
server_is_gone() { ! kill -0 "$(cat "$world/server")" 2>/dev/null; }

without_terminal() { "$demo" "$@" >"$world/said" 2>&1 </dev/null; }
check "it ends by itself where there is no terminal" without_terminal --open
check "it does not wait there" silent "stays open"
check "the report shows the growing map" grep -q '(growing.png)' "$world/out/report.md"
check "the animation is named at the end" grep -q "$world/out/growing.png" <(tail -n 1 "$world/said")
check "without a display no browser is opened" said "open does nothing"
check "its server ends with it" server_is_gone

export DISPLAY=:9
set -m  # Otherwise what runs in the background ignores SIGINT.
"$demo" --keep --open >"$world/said" 2>&1 </dev/null &
kept=$!
set +m
for _ in $(seq 1500); do if said "stays open"; then break; fi; sleep 1; done
check "with --keep the page stays open" grep -q "stays open at http://127.0.0.1:9/: press Enter" <(tail -n 1 "$world/said")
check "so does the server" kill -0 "$(cat "$world/server")"
check "the browser shows the page" grep -qx "http://127.0.0.1:9/" "$world/opened"
kill -INT "$kept"
check "Ctrl-C ends it well" wait "$kept"
check "and its server with it" server_is_gone

# In a terminal: Enter is pressed when it asks for it.
in_terminal() {
  python3 - "$@" <<'END' >"$world/said"
import os
import pty
import sys

child, terminal = pty.fork()
if child == 0:
    os.execv(sys.argv[1], sys.argv[1:])
said, pressed = b"", False
while True:
    try:
        piece = os.read(terminal, 4096)
    except OSError:  # The other end is closed.
        break
    if not piece:
        break
    said += piece
    if b"press Enter" in said and not pressed:
        pressed = os.write(terminal, b"\n") > 0
print(said.decode())
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
END
}
rm "$world/opened"
check "in a terminal Enter ends it well" in_terminal "$demo"
check "in a terminal the page stays open" said "stays open at http://127.0.0.1:9/"
check "its server ends with it, too" server_is_gone
check "without --open no browser is opened" [ ! -e "$world/opened" ]
check "with --no-keep it ends by itself there, too" in_terminal "$demo" --no-keep
check "it does not wait" silent "stays open"
exit $status
