#!/usr/bin/env bash
# The accuracy figure CI holds: mit-csail through cairn-offline, mean translational error over the verified relations at
# most 0.106 m (the scan-matching column of Kuemmerle et al. 2009): gate.sh BIN_DIR [OUT_DIR]
# The log is not part of the repository: it is looked for in $CAIRN_DATA, then in ../shared/data.
# Exit code: 0 good enough, 77 skipped for want of data, 1 otherwise.
set -euo pipefail

bin=${1:?usage: gate.sh BIN_DIR [OUT_DIR]}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
data=$(realpath -m "${CAIRN_DATA:-$here/../../../shared/data}")
out=${2:-$(mktemp -d)}
log=$data/mit-csail.clf
relations=$data/mit-csail.relations

if [ ! -r "$log" ] || [ ! -r "$relations" ]; then
  echo "SKIPPED: no accuracy figure, because $data has no mit-csail.clf and mit-csail.relations; set CAIRN_DATA"
  exit 77
fi
mkdir -p "$out"
"$bin/cairn-offline" "$log" --trajectory "$out/mit-csail.tum" --map "$out/mit-csail.yaml" --json
python3 "$here/relations_metric.py" "$out/mit-csail.tum" "$relations" --max-trans-mean 0.106
