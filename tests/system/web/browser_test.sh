#!/usr/bin/env bash
# The page in a real browser: browser_test.mjs with Debian's chromium and playwright-core of the npm registry.
# Usage: browser_test.sh SOURCE_DIR BIN_DIR WORK_DIR [PICTURES]. Installs what it lacks; exit code 77, with the line
# `SKIPPED: why`, where it cannot. PICTURES: a folder for the pictures of the documentation.
set -euo pipefail

source=$1 bin=$2 work=$3 pictures=${4:-}
here=$source/tests/system/web
mkdir -p "$work"

skip() { echo "SKIPPED: $*"; exit 77; }
if ! command -v chromium >/dev/null || ! command -v npm >/dev/null; then
  "$source/deploy/install-packages.sh" test >"$work/packages.log" 2>&1 || skip "chromium or npm cannot be installed: $(tail -n 1 "$work/packages.log")"
fi
chromium=$(command -v chromium) || skip "there is no chromium"
if [ ! -d "$work/node_modules/playwright-core" ] || ! cmp -s "$here/package.json" "$work/package.json"; then
  cp "$here/package.json" "$work/package.json"
  (cd "$work" && timeout 120 npm install --no-audit --no-fund --no-package-lock --loglevel=error) >"$work/npm.log" 2>&1 ||
    skip "npm cannot install playwright-core: $(tail -n 1 "$work/npm.log")"
fi
cp "$here/browser_test.mjs" "$work/"
cd "$work"
CHROMIUM=$chromium CAIRN_BIN=$bin PICTURES=$pictures exec node browser_test.mjs
