#!/usr/bin/env bash
# The files of deploy/monitoring as Prometheus itself reads them, and what the alerts say of the series in alerts_test.yml:
# alert_rules_test.sh SOURCE_DIR CACHE_DIR
# promtool is in Debian's package prometheus. Its installation would start a server on this machine, so it is only unpacked,
# into CACHE_DIR; this needs no root, and a network once. Exit code 77: promtool cannot be had.
set -euo pipefail

source_dir=$1
cache=$2

skip() { echo "SKIPPED: no promtool: $*"; exit 77; }

# One command behind the other, because the function is called where `set -e` does not hold.
unpack() { # folder
  cd "$1" && timeout 120 apt-get -q -o Acquire::Retries=1 -o Acquire::http::Timeout=20 download prometheus &&
    dpkg-deb --fsys-tarfile prometheus_*.deb | tar -x ./usr/bin/promtool
}

promtool=$(command -v promtool || true)
if [ -z "$promtool" ]; then
  promtool=$cache/promtool
  if [ ! -x "$promtool" ]; then
    command -v apt-get >/dev/null || skip "this machine has no apt-get to get the package prometheus with"
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
    (unpack "$folder") >"$folder/said" 2>&1 ||
      skip "the package prometheus could not be unpacked: $(tail -n 1 "$folder/said")"
    mkdir -p "$cache"
    mv "$folder/usr/bin/promtool" "$promtool"
  fi
fi

cd "$source_dir/deploy/monitoring"
"$promtool" check rules alerts.yml
"$promtool" check config prometheus.yml
"$promtool" test rules "$source_dir/tests/deploy/alerts_test.yml"
