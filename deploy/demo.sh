#!/usr/bin/env bash
# The demo builds Cairn, starts a server on its own DDS domain, and streams three simulated robots in one building
# into one map, which a page shows in the browser. It asks for poses and tiles meanwhile, smooths the paths, and compares
# them with the truth.
# Usage: deploy/demo.sh [OPTIONS] [LOG]. A robot log given as LOG is replayed into a second site. No display is needed.
#   --secure    with DDS Security: every program gets an identity and only the rights of its role (deploy/security/)
#   --keep      the page stays open at the end, until Enter or Ctrl-C
#   --no-keep   it does not. Without either option it stays open where the demo was started in a terminal
#   --open      opens the page in the browser of this machine, if there is a display
# Output in demo-out/ (or $DEMO_OUT): report.md, map.png, growing.png (how the map grew; every browser plays it),
# building.yaml, trajectories, and the server's log.
# DEMO_SECONDS (150) sets how long the robots drive, and DEMO_RATE (3) how much faster than real time. On a
# slow machine they wait for the server.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
usage() { sed -n '2,/^set/s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"; }
secure= open= log= logs=0
keep=no
if [ -t 0 ] && [ -t 1 ]; then keep=yes; fi
for word in "$@"; do
  case $word in
    --secure) secure=yes ;;
    --keep) keep=yes ;;
    --no-keep) keep=no ;;
    --open) open=yes ;;
    -h | --help) usage; exit 0 ;;
    -*) echo "demo: unknown option: $word" >&2; usage >&2; exit 2 ;;
    *) log=$word logs=$((logs + 1)) ;;
  esac
done
out=$(realpath -m "${DEMO_OUT:-$root/demo-out}")
seconds=${DEMO_SECONDS:-150}
rate=${DEMO_RATE:-3}
robots=(robot1 robot2 robot3)
bin=$root/build/release/bin
# A domain that other programs are unlikely to use. Up to domain 101, its ports lie below those that the
# kernel assigns to other programs.
export CAIRN_DOMAIN=${CAIRN_DOMAIN:-$((60 + $$ % 42))}

if [ "$logs" -gt 1 ]; then usage >&2; exit 2; fi
if [ -n "$log" ] && [ ! -r "$log" ]; then echo "demo: cannot read $log" >&2; exit 2; fi
if [ -n "$log" ]; then log=$(realpath "$log"); fi
# The folder is emptied below, so refuse one that no demo has made.
if [ -n "$(ls -A "$out" 2>/dev/null)" ] && [ ! -e "$out/cairnd.log" ]; then
  echo "demo: $out contains files that are not from a demo; set DEMO_OUT to another folder" >&2
  exit 2
fi

step() { printf '\n== %s\n' "$*"; }
fail() { echo "demo: $*" >&2; exit 1; }

# The options of one member of the fleet: server, robots/NAME, viewers/NAME or operators/NAME.
as() { if [ -n "$secure" ]; then echo --set "wire.security=fleet/$1"; fi; }
# Asks as a viewer, who may change nothing.
ask() { "$bin/cairn" $(as viewers/desk) "$@"; }

server=
sim=
web=
growing=
clean_up() {
  local code=$?
  trap - EXIT HUP INT TERM
  for pid in $sim $growing $web $server; do
    kill -TERM "$pid" 2>/dev/null || continue
    for _ in $(seq 50); do kill -0 "$pid" 2>/dev/null || break; sleep 0.1; done
    kill -KILL "$pid" 2>/dev/null || true
  done
  exit "$code"
}
trap clean_up EXIT
trap 'exit 129' HUP
trap 'exit 130' INT
trap 'exit 143' TERM

step "building (the first time takes some minutes)"
"$root/deploy/install-packages.sh" build
(cd "$root" && cmake --preset release >/dev/null &&
  cmake --build --preset release -j "$(deploy/build-jobs.sh)" --target cairnd cairn cairn-web)

rm -rf "$out"
mkdir -p "$out/truth"
cd "$out"
began=$(date +%s)

if [ -n "$secure" ]; then
  step "making the identities of the fleet"
  "$root/deploy/security/make-fleet.sh" fleet --robots "sim=robot1+robot2+robot3,log" --viewers desk,web,film --operators boss --days 1
fi

step "starting cairnd on domain $CAIRN_DOMAIN"
# The server and the page are in process groups of their own: Ctrl-C in the terminal ends this script, which stops them.
set -m
"$bin/cairnd" $(as server) --state none </dev/null >cairnd.log 2>&1 &
server=$!
set +m
for attempt in $(seq 40); do
  if ask ping --timeout 500ms >ping.txt 2>/dev/null; then break; fi
  kill -0 "$server" 2>/dev/null || { cat cairnd.log >&2; fail "the server ended right after its start; its log is above"; }
  [ "$attempt" -lt 40 ] || fail "the server does not answer; see $out/cairnd.log"
  sleep 0.25
done
cat ping.txt

step "showing the map in the browser"
: >web.txt  # It is read at once, maybe before the page's process has made it.
set -m
"$bin/cairn-web" $(as viewers/web) --port 0 </dev/null >web.txt 2>&1 &
web=$!
set +m
for attempt in $(seq 40); do
  address=$(sed -n 's|^cairn-web: \(http://.*\)|\1|p' web.txt)
  [ -z "$address" ] || break
  kill -0 "$web" 2>/dev/null || { cat web.txt >&2; fail "cairn-web ended right after its start; see above"; }
  [ "$attempt" -lt 40 ] || fail "cairn-web does not say where its page is; see $out/web.txt"
  sleep 0.25
done
echo "Open $address in a browser on this machine, while the robots drive."
if [ -n "$open" ]; then
  if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ] && command -v xdg-open >/dev/null; then
    xdg-open "$address" >/dev/null 2>&1 &
  else
    echo "--open does nothing: there is no display, or no xdg-open."
  fi
fi

step "three robots drive through one building for $seconds s, at $rate times real time"
"$bin/cairn" $(as robots/sim) sim --world building --robots 3 --beams 360 --hz 10 --seconds "$seconds" --rate "$rate" --window 32 --site building \
  --truth-dir truth --watch-pid "$server" >sim.txt 2>sim-progress.txt &
sim=$!
# Looks at the map until it is told to stop, and then draws what it has seen.
"$bin/cairn" $(as viewers/film) map animate --site building --robots "${robots[@]}" --frames 40 --width 720 \
  --title "Three robots, one building, one map" -o growing.png >growing.txt 2>&1 &
growing=$!
while kill -0 "$sim" 2>/dev/null; do
  for _ in 1 2 3 4 5; do if kill -0 "$sim" 2>/dev/null; then sleep 1; fi; done
  kill -0 "$sim" 2>/dev/null || break
  tail -n 1 sim-progress.txt
  for robot in "${robots[@]}"; do ask pose "$robot" || true; done
  ask tiles --site building --level 2 | tail -n 1 || true
done
wait "$sim" || { sim=; cat sim.txt sim-progress.txt >&2; fail "the simulation failed, or scans were lost; see above"; }
sim=
kill -TERM "$growing" 2>/dev/null || true
cat sim.txt

step "asking the server for its state and the paths"
ask status | tee status.txt
ask map info --site building
for robot in "${robots[@]}"; do ask path "$robot" -o "$robot.tum"; done
ask map export --site building -o building-online.yaml

step "smoothing the whole trajectories"
if [ -n "$secure" ]; then
  echo "A viewer may not do this:"
  if ask job smooth --site building 2>denied.txt || ! grep -q PERMISSION_DENIED denied.txt; then
    cat denied.txt >&2
    fail "a viewer is not refused a job"
  fi
  cat denied.txt
fi
"$bin/cairn" $(as operators/boss) job smooth --site building --wait | tee job.txt
for robot in "${robots[@]}"; do ask path "$robot" --smoothed -o "$robot-smooth.tum"; done
ask map export --site building -o building.yaml
ask map draw --site building --paths robot1=robot1-smooth.tum robot2=robot2-smooth.tum robot3=robot3-smooth.tum \
  --title "Three robots, one building, one map" -o map.png

wait "$growing" || { growing=; cat growing.txt >&2; fail "the growing map was not drawn; see above"; }
growing=
tail -n 1 growing.txt

if [ -n "$log" ]; then
  step "replaying the log $(basename "$log") into a second site, as fast as the server takes it"
  "$bin/cairn" $(as robots/log) replay "$log" --site log --robot log --fast | tee replay.txt
  ask path log -o log.tum
  ask map export --site log -o log.yaml
  ask map draw --site log --paths log.tum --title "$(basename "$log")" -o log-map.png
fi

step "computing the errors against the truth"
quote() { sed 's/^/    /' "$1"; }
rmse() { "$bin/cairn" eval "$1" "$2" --json | sed -n 's/.*"ate_rmse_m":\([0-9.e+-]*\).*/\1/p'; }
{
  printf '# Cairn demo, %s\n\n![map](map.png)\n\nWhile the robots drove:\n\n![the map grows](growing.png)\n\n' "$(date -u +%F)"
  printf 'Three simulated robots in one site, %s s at %s times real time. The start poses are given; the paths are not aligned with the truth.\n\n' "$seconds" "$rate"
  printf '| robot | online: ATE rmse, m | smoothed: ATE rmse, m |\n|---|---|---|\n'
  for robot in "${robots[@]}"; do
    printf '| %s | %.4f | %.4f |\n' "$robot" "$(rmse "$robot.tum" "truth/$robot.tum")" \
      "$(rmse "$robot-smooth.tum" "truth/$robot.tum")"
  done
  printf '\n## Scans used and dropped\n\n'; quote sim.txt
  printf '\n## Smoothing\n\n'; quote job.txt
  if [ -n "$log" ]; then
    printf '\n## %s\n\n![map of the log](log-map.png)\n\n' "$(basename "$log")"; quote replay.txt
  fi
  printf '\n## Files\n\n- building.yaml and its .png: the map after smoothing, for Nav2 (building-online.*: before smoothing)\n'
  printf -- '- *.tum: the online paths (*-smooth.tum: the smoothed paths), truth/*.tum: the true paths\n'
  printf -- '- cairnd.log: the log of the server\n'
} >report.md
sed -n '/^| robot/,/^$/p' report.md

left="The report, the map and the trajectories are in $out. The demo took $(($(date +%s) - began)) s after the build.
$out/growing.png shows how the map grew; every browser plays it."
if [ "$keep" = yes ]; then
  printf '\n%s\n' "$left"
  echo "Ask the server, too: cd $out && CAIRN_DOMAIN=$CAIRN_DOMAIN" "$bin/cairn" $(as viewers/desk) status
  printf '\nThe map stays open at %s: press Enter to stop.\n' "$address"
  stop=
  trap 'stop=yes' INT
  # A look each second, so that the demo also ends with its programs. Without a terminal to read from, Ctrl-C ends it.
  while [ -z "$stop" ] && kill -0 "$web" 2>/dev/null && kill -0 "$server" 2>/dev/null; do
    code=0
    if [ -t 0 ]; then read -r -t 1 || code=$?; else sleep 1 || true; code=142; fi
    [ "$code" -gt 128 ] || stop=yes
  done
  trap 'exit 130' INT
fi

step "stopping the page and the server"
kill -TERM "$web" 2>/dev/null || true
wait "$web" || fail "cairn-web did not stop cleanly"
web=
kill -TERM "$server" 2>/dev/null || true
wait "$server" || fail "the server did not stop cleanly; see $out/cairnd.log"
server=
rm -f ping.txt sim-progress.txt web.txt growing.txt
[ "$keep" = yes ] || echo "$left"
