#!/usr/bin/env bash
# Other software as a witness of bags and recordings: the libraries of MCAP's makers and of Foxglove, by npm in the
# versions of package-lock.json. What they write, Cairn reads; what `cairn record` writes, they read.
# Usage: witness_test.sh BIN_DIR OUT_DIR
set -euo pipefail

bin=$(realpath "$1")
out=$(realpath -m "$2")
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
mkdir -p "$out"
cp "$here"/*.json "$here"/*.mjs "$out/"
cd "$out"
npm ci --no-audit --no-fund --loglevel=error
node read_bags.mjs "$bin" "$out/bags"

export CAIRN_DOMAIN=${CAIRN_DOMAIN:-$((60 + $$ % 42))}
pids=()
clean_up() {
  local pid
  for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait
}
trap clean_up EXIT
"$bin/cairnd" --state none --set wire.interfaces=127.0.0.1 >cairnd.log 2>&1 &
pids+=($!)
cairn() { "$bin/cairn" --set wire.interfaces=127.0.0.1 "$@"; }
for attempt in $(seq 60); do
  if cairn ping --timeout 500ms >ping.txt 2>&1; then break; fi
  [ "$attempt" -lt 60 ] || { cat cairnd.log ping.txt; exit 1; }
done
"$bin/cairn" --set wire.interfaces=127.0.0.1 record recorded.mcap --force --map-every 1 >record.txt 2>&1 &
recorder=$!
pids+=("$recorder")
cairn sim --site hall --robots 2 --beams 181 --seconds 8 --rate 2 >sim.txt 2>&1 || { cat sim.txt; exit 1; }
kill -INT "$recorder"
wait "$recorder" || { cat record.txt; exit 1; }
cat record.txt
node read_recording.mjs "$bin" recorded.mcap
