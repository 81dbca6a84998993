#!/usr/bin/env bash
# A project outside the tree that uses the installed client library: find_package_test.sh SOURCE_DIR BUILD_DIR COMPILER
# Its program is the example of client/lib/README.md, so that the example compiles, too.
set -euo pipefail

source_dir=$1 build=$2 compiler=$3
world=$(mktemp -d)
trap 'rm -rf "$world"' EXIT
cmake --install "$build" --component development --prefix "$world/installed" >"$world/said"

mkdir "$world/robot"
cat >"$world/robot/CMakeLists.txt" <<'PROJECT'
cmake_minimum_required(VERSION 3.22)
project(robot LANGUAGES CXX)
find_package(cairn 0.1 REQUIRED)
add_executable(robot robot.cpp drivers.cpp)
target_link_libraries(robot PRIVATE cairn::client)
PROJECT
# shellcheck disable=SC2016  # The backquotes are Markdown.
sed -n '/^```cpp$/,/^```$/p' "$source_dir/client/lib/README.md" | grep -v '^```' >"$world/robot/robot.cpp"
grep -q 'RobotClient::Open' "$world/robot/robot.cpp"
cat >"$world/robot/drivers.cpp" <<'DRIVERS'
#include "client/lib/robot_client.h"
bool NextScan(cairn::Scan*, cairn::Odometry*) { return false; }
DRIVERS
cmake -S "$world/robot" -B "$world/build" -DCMAKE_PREFIX_PATH="$world/installed" -DCMAKE_CXX_COMPILER="$compiler"
cmake --build "$world/build"
# Nothing of the source or the build tree is needed any more.
if grep -rlF --include="*.cmake" -e "$source_dir" "$world/installed"; then
  echo "FAILED: the package names the tree it was built in"
  exit 1
fi
