#!/usr/bin/env bash
# The accuracy CI holds: real logs through cairn-offline, both the poses of the time (online) and the smoothed ones, at
# most a fifth worse than what the project claims: gate.sh BIN_DIR [OUT_DIR]
# The logs are not part of the repository: they are looked for in $CAIRN_DATA, then in ../shared/data.
# Exit code: 1 when a figure is worse or a program failed, else 77 when a log is absent (said loudly), else 0.
set -euo pipefail

bin=${1:?usage: gate.sh BIN_DIR [OUT_DIR]}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
data=$(realpath -m "${CAIRN_DATA:-$here/../../../shared/data}")
out=${2:-$(mktemp -d)}
mkdir -p "$out"
failed=0 absent=0

# NAME LOG REFERENCE METRIC LIMIT_OPTION ONLINE SMOOTHED [OPTION...]: one log, held in both forms; the options are those of
# cairn-offline.
hold() {
  local name=$1 needs="$2 or $3" log=$data/$2 reference=$data/$3 metric=$4 option=$5 online=$6 smoothed=$7
  shift 7
  if [ ! -r "$log" ] || [ ! -r "$reference" ]; then
    echo "SKIPPED: no accuracy figure of $name, because $data lacks $needs; set CAIRN_DATA"
    absent=1
    return
  fi
  if ! "$bin/cairn-offline" "$log" --trajectory "$out/$name.tum" --smoothed-trajectory "$out/$name.smoothed.tum" \
    --map "$out/$name.yaml" --json "$@"; then
    echo "FAILED: cairn-offline on $name"
    failed=1
    return
  fi
  local form limit trajectory
  for form in online smoothed; do
    limit=$online trajectory=$out/$name.tum
    [ $form = online ] || { limit=$smoothed trajectory=$out/$name.smoothed.tum; }
    echo "$name, $form, at most $limit:"
    if ! python3 "$here/$metric" "$trajectory" "$reference" "$option" "$limit"; then
      echo "FAILED: $name, $form"
      failed=1
    fi
  done
}

# Claimed in README.md: 0.029 m online, 0.027 m smoothed.
hold mit-csail mit-csail.clf mit-csail.relations relations_metric.py --max-trans-mean 0.0352 0.0324
# A small robot with a cheap lidar, watched by a camera: 0.020 m. Its wheels alone are at 0.028 m.
hold lego lowcost/lego_urg04lx_robot4.log lowcost/lego_urg04lx_robot4_positions.tum positions_metric.py \
  --max-mean 0.0243 0.0243
# A corridor longer than its rolling lidar sees, at 25 scans a second: only odometry shows the way along it.
furo=lowcost/furo_lsc_corridor-degene.log
hold furo $furo $furo way_metric.py --max-share 0.02 0.02 --scan-period 0.04 --stamp-at middle --clockwise --turn-from 180

[ $failed -eq 0 ] || exit 1
[ $absent -eq 0 ] || exit 77
