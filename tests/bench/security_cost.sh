#!/usr/bin/env bash
# What DDS Security costs: the time from a scan to its pose, and the processor time of the server and of the robots, with
# and without it. Usage: security_cost.sh BIN_DIR [ROBOTS] [SECONDS]. Simulated robots, 10 Hz, 360 beams, loopback.
set -euo pipefail

bin=$(realpath "$1")
robots=${2:-4}
seconds=${3:-20}
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
scratch=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill "$server" 2>/dev/null || true; rm -rf "$scratch"' EXIT
cd "$scratch"
export CAIRN_DOMAIN=${CAIRN_DOMAIN:-$((60 + $$ % 42))}
names=$(seq -f 'robot%g' -s + "$robots")
"$root/deploy/security/make-fleet.sh" fleet --robots "sim=$names" >/dev/null

ticks() { cut -d ' ' -f 14,15 "/proc/$1/stat" | tr ' ' '\n' | paste -sd + | bc; }
measure() { # name, options of the server, options of the robots
  "$bin/cairnd" --state none $2 >cairnd.log 2>&1 &
  server=$!
  until grep -q ready cairnd.log; do kill -0 "$server"; sleep 0.1; done
  local before said robots_s
  before=$(ticks "$server")
  said=$({ TIMEFORMAT=%U+%S; time "$bin/cairn" $3 sim --robots "$robots" --beams 360 --hz 10 --seconds "$seconds" \
    --site cost >sim.txt 2>progress.txt; } 2>&1)
  robots_s=$(bc <<<"$said")
  printf '%-8s %s\n' "$1" "$(tail -n 1 sim.txt)"
  awk -v s="$(($(ticks "$server") - before))" -v r="$robots_s" -v hz="$(getconf CLK_TCK)" -v t="$seconds" \
    'BEGIN { printf "         processor: server %.1f %%, robots %.1f %% of a core\n", 100 * s / hz / t, 100 * r / t }'
  kill "$server"
  wait "$server" || true
  server=
}
measure plain "" ""
measure secure "--set wire.security=fleet/server" "--set wire.security=fleet/robots/sim"
