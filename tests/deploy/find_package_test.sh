#!/usr/bin/env bash
# A project outside the tree that uses the installed client library: find_package_test.sh SOURCE_DIR BUILD_DIR COMPILER
# The project is the example of client/lib, whose program is the one in README.md, so that both compile.
set -euo pipefail

source_dir=$1 build=$2 compiler=$3
world=$(mktemp -d)
trap 'rm -rf "$world"' EXIT
failed=0
for component in library development; do
  cmake --install "$build" --component $component --prefix "$world/installed" >"$world/said"
done

example=$world/installed/share/doc/libcairn-dev/examples/robot
# shellcheck disable=SC2016  # The backquotes are Markdown.
sed -n '/^```cpp$/,/^```$/p' "$source_dir/client/lib/README.md" | grep -v '^```' >"$world/readme.cpp"
if ! diff "$world/readme.cpp" <(grep -v '^//' "$example/robot.cpp"); then
  echo "FAILED: README.md of client/lib shows another program than the example"
  failed=1
fi
cp -r "$example" "$world/robot"
# Every header that is installed must find what it includes.
(cd "$world/installed/include/cairn" && find . -name '*.h' | sed 's|^\./\(.*\)|#include "\1"|') >"$world/robot/headers.cpp"
grep -q '^#include "client/lib/query_client.h"$' "$world/robot/headers.cpp"
sed -i 's/ drivers\.cpp/& headers.cpp/' "$world/robot/CMakeLists.txt"
cmake -S "$world/robot" -B "$world/build" -DCMAKE_PREFIX_PATH="$world/installed" -DCMAKE_CXX_COMPILER="$compiler"
cmake --build "$world/build"
libraries=$(readelf --dynamic "$world/build/robot" | grep NEEDED)
grep -q 'libcairn\.so\.[0-9]' <<<"$libraries"
if grep -E 'fastrtps|opencv' <<<"$libraries"; then
  echo "FAILED: the program itself links what only the library needs"
  failed=1
fi

# Every function of the static libraries is in the shared one for programs to call, and with them those that take the place
# of functions of Fast DDS; without what needs OpenCV (client/lib/CMakeLists.txt).
nm --defined-only "$build"/{client/lib/libcairn_client,common/libcairn_common,common/wire/libcairn_wire,idl/libcairn_idl}.a |
  awk '/:$/ { left_out = /unity_images|image_codec|map_yaml/ } !left_out && $2 == "T" { print $3 }' | sort -u >"$world/functions"
nm --dynamic --defined-only "$world/installed/lib/libcairn.so" | awk '{ print $3 }' | sort -u >"$world/exported"
[ -s "$world/functions" ]
missing=$(comm -23 "$world/functions" "$world/exported" | c++filt)
if [ -n "$missing" ]; then
  echo "FAILED: libcairn.so does not export"
  echo "$missing"
  failed=1
fi
# Each client of a robot would load the packages that OpenCV brings.
if readelf --dynamic "$world/installed/lib/libcairn.so" | grep 'NEEDED.*opencv'; then
  echo "FAILED: libcairn.so needs OpenCV"
  failed=1
fi
# Nothing of the source or the build tree is needed any more.
if grep -rlF --include="*.cmake" -e "$source_dir" "$world/installed"; then
  echo "FAILED: the package names the tree it was built in"
  failed=1
fi
exit $failed
