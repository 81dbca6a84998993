#!/usr/bin/env bash
# Builds the Debian packages of Cairn and checks them with lintian: make-packages.sh [BUILD_DIR]
# Installs what is missing for that, compiles in BUILD_DIR (build/release), and leaves the packages in BUILD_DIR/packages.
# Install them with `sudo apt install ./build/release/packages/*.deb`. Exit code 1 where lintian finds an error or warns.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
[ $# -le 1 ] || { sed -n '2,4s/^# \{0,1\}//p' "$0" >&2; exit 2; }
build=${1:-build/release}

deploy/install-packages.sh build package
# A file that an earlier run has put together would be packed again.
rm -rf "$build/packages" "$build/_CPack_Packages"
cmake --preset release -B "$build"
cmake --build "$build" -j "$(deploy/build-jobs.sh)" \
  --target cairnd cairn cairn-web cairn-offline cairn-calibrate cairn_shared man_pages
# Not the umask of whoever runs this.
(umask 022 && cd "$build" && fakeroot cpack -G DEB)
packages=("$build"/packages/*.deb)
lintian --tag-display-limit 0 --fail-on error,warning "${packages[@]}"
du -h "${packages[@]}"
