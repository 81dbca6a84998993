#!/usr/bin/env bash
# The one command: installs what is missing, builds every way that counts, runs every test, holds the accuracy.
#   tests/run.sh                 packages to tsan below; stops at the first that fails
#   tests/run.sh --full          clang-tidy, every test in the ordinary build and under the address sanitizer, every source by
#                                itself, the demo with DDS Security, Debian packages, containers, and a real systemd, besides
#   tests/run.sh --quick         packages, format, architecture, release
#   tests/run.sh --stage NAME    this stage (may be repeated), with the build it needs
#   tests/run.sh --studies       whatever else is asked for, and the slow studies (tests/studies) last
# What each stage does and why it stands where it stands: tests/README.md. Needs no terminal and asks nothing.
# The last line counts tests and checks: `N passed, N failed, N skipped`. Exit code: 0 none failed, 1 some, 2 usage.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
all=(packages format architecture release accuracy demo nodds asan fuzz tsan)
full=(tidy asan_rest plain demo_secure debs containers recordings systemd)
stages=()
studies=()
full_too=0

usage() { sed -n '2,/^set/s/^# \{0,1\}//p' "$0"; echo "stages: ${all[*]} ${full[*]} studies"; }
while [ $# -gt 0 ]; do
  case $1 in
    --quick) stages+=(packages format architecture release) ;;
    --full) full_too=1 ;;
    --studies) studies=(studies) ;;
    --stage)
      case " ${all[*]} ${full[*]} studies " in
        *" ${2:-none} "*) ;;
        *) echo "--stage needs one of: ${all[*]} ${full[*]} studies" >&2; exit 2 ;;
      esac
      stages+=("$2")
      shift ;;
    -h | --help) usage; exit 0 ;;
    *) echo "unknown option: $1" >&2; usage >&2; exit 2 ;;
  esac
  shift
done
[ ${#stages[@]} -gt 0 ] || stages=("${all[@]}")
[ "$full_too" -eq 0 ] || stages+=("${full[@]}")
stages+=("${studies[@]}")

jobs=${CAIRN_JOBS:-$(deploy/build-jobs.sh)}
# Many tests wait for a timer of the middleware half of their time.
tests_at_once=$((jobs + 1))

# One compiler cache for all build folders and clones: paths relative to the root, and precompiled headers allowed.
export CCACHE_BASEDIR=$root CCACHE_SLOPPINESS=pch_defines,time_macros
export GTEST_COLOR=no CLICOLOR=0
[ -w "${HOME:-/nowhere}" ] || export CCACHE_DIR=$root/build/ccache
logs=$root/build/logs
mkdir -p "$logs"

# Sanitizers want a fixed memory layout; newer kernels' randomisation is too wide for clang 14's.
fixed_layout=()
if setarch "$(uname -m)" -R true 2>/dev/null; then fixed_layout=(setarch "$(uname -m)" -R); fi
export ASAN_OPTIONS=detect_stack_use_after_return=1:strict_string_checks=1
export UBSAN_OPTIONS=print_stacktrace=1
# The middleware is built without the thread sanitizer: its own accesses are overlooked, its locks are not. (A suppression
# `called_from_lib:` would overlook the locks as well, and every callback would look like a race.)
export TSAN_OPTIONS=ignore_noninstrumented_modules=1:second_deadlock_stack=1

configure() { # preset, cmake options
  local preset=$1
  shift
  cmake --preset "$preset" -DCAIRN_STRICT=ON "$@"
}

build() { # folder, cmake --build options
  local folder=$1
  shift
  "${fixed_layout[@]}" cmake --build "build/$folder" -j "$jobs" "$@"
}

run_tests() { # folder, ctest options
  local folder=$1
  shift
  rm -rf "build/$folder/gtest"
  local code=0
  "${fixed_layout[@]}" ctest --test-dir "build/$folder" -j "$tests_at_once" --output-on-failure --no-tests=error \
    --output-junit "$logs/$stage.xml" "$@" || code=$?
  python3 tests/count_tests.py "$logs/$stage.xml" "build/$folder/gtest" >"$logs/$stage.count"
  return "$code"
}

stage_packages() { deploy/install-packages.sh build test; }

stage_format() {
  local sources
  mapfile -t sources < <(tracked '*.h' '*.cpp' '*.c')
  printf '%s\0' "${sources[@]}" | xargs -0 -n 32 -P "$jobs" clang-format --dry-run -Werror
  echo "${#sources[@]} files keep to .clang-format"
}

# What git knows; in an unpacked archive, what is there.
tracked() {
  if git rev-parse --git-dir >/dev/null 2>&1; then
    git ls-files -co --exclude-standard -- "$@" | while read -r file; do [ ! -f "$file" ] || echo "$file"; done
  else
    local pattern names=()
    for pattern in "$@"; do names+=(-o -name "$pattern"); done
    find common server client tests idl -type f \( "${names[@]:1}" \)
  fi
}

stage_architecture() { python3 tests/architecture/include_direction.py "$root"; }

# Where the address sanitizer comes after it and it is not --full, the tests that run there are left to it.
stage_release() {
  case " ${stages[*]} " in
    *" asan_rest "*) ;;
    *" asan "*)
      configure release -DCAIRN_TESTS_ONCE=ON
      build release
      run_tests release -LE 'study|twice'
      return ;;
  esac
  configure release -DCAIRN_TESTS_ONCE=OFF
  build release
  run_tests release -LE study
}

stage_accuracy() {
  configure release
  build release --target cairn-offline
  tests/accuracy/gate.sh build/release/bin build/accuracy
}

# The README's first command, cut short. Finds what the release stage built.
run_demo() { # folder, options of demo.sh
  local folder=$1
  shift
  DEMO_SECONDS=20 DEMO_OUT=$root/build/$folder deploy/demo.sh "$@"
  local left frames
  for left in map.png growing.png report.md; do [ -s "build/$folder/$left" ] || { echo "the demo left no $left"; return 1; }; done
  frames=$(grep -ao fcTL "build/$folder/growing.png" | wc -l) || true
  [ "$frames" -ge 3 ] || { echo "the picture of the growing map has $frames frames"; return 1; }
}

stage_demo() { run_demo demo; }

# Every program with its identity and the rights of its role.
stage_demo_secure() { run_demo demo-secure --secure; }

# The same flags as release: the compiler cache hands over every object. That it builds and links is new; of the tests,
# which passed as the same objects in release, those of the estimator as a whole.
stage_nodds() {
  configure release -B build/nodds -DCAIRN_WITH_DDS=OFF
  build nodds --target cairn-offline cairn-calibrate cairn-study slam_mapper_test
  run_tests nodds -R '^slam_mapper$'
}

# The ordinary build: every source by itself, no precompiled header. It finds a missing include, which a build of several
# sources to a translation unit can not see. The programs and all they link; nothing is run but their version.
stage_plain() {
  configure plain
  build plain --target cairnd cairn cairn-offline cairn-calibrate cairn-web
  local program
  for program in cairnd cairn cairn-offline cairn-calibrate cairn-web; do "build/plain/bin/$program" --version; done
}

stage_asan() {
  configure asan
  build asan --target asan_tests
  run_tests asan -L asan
}

stage_asan_rest() {
  configure asan
  build asan
  run_tests asan -LE 'study|fuzz|asan'
}

# Finds what asan built.
stage_fuzz() {
  configure asan
  build asan --target fuzzers
  run_tests asan -L fuzz
}

stage_tsan() {
  configure tsan
  build tsan --target tsan_tests
  tests_at_once=$jobs run_tests tsan -L tsan  # These compute more than they wait.
}

# Nothing is compiled. All sources of a target at once: one by one they take ten times as long.
stage_tidy() {
  configure asan -B build/tidy -DCMAKE_UNITY_BUILD_BATCH_SIZE=0
  build tidy --target cairn_idl_sources cairn_record_sources cairn_recording_sources
  python3 tests/tidy.py build/tidy --jobs "$jobs"
}

# Root only: the packages are installed in a system of their own.
stage_debs() {
  deploy/make-packages.sh build/release
  if [ "$(id -u)" -ne 0 ]; then echo "SKIPPED: not root"; return 77; fi
  deploy/install-packages.sh boot
  tests/deploy/packages_test.sh build/release/packages build/debs
}

# The checkers are npm's, in the versions of package-lock.json.
stage_containers() {
  command -v npm >/dev/null || deploy/install-packages.sh containers
  mkdir -p build/containers
  cp tests/deploy/containers/* build/containers/
  cd build/containers
  npm ci --no-audit --no-fund --loglevel=error
  npx dockerfilelint "$root/deploy/containers/Dockerfile"
  npx dclint -c dclint.json --max-warnings 0 "$root/deploy/containers/compose.yaml"
  node manifests.mjs "$root"/deploy/containers/kubernetes/[!k]*.yaml
  cd "$root"
  if [ "$(id -u)" -ne 0 ]; then echo "SKIPPED: not root, so that no image can be built"; return 77; fi
  deploy/install-packages.sh images
  deploy/make-packages.sh build/release
  tests/deploy/images_test.sh build/release/packages build/images
}

# Bags and recordings, with the libraries of MCAP's makers and of Foxglove as witnesses.
stage_recordings() {
  command -v npm >/dev/null || deploy/install-packages.sh containers
  if ! npm ping --loglevel=error >/dev/null 2>&1; then echo "SKIPPED: the registry of npm is not reachable"; return 77; fi
  configure release
  build release --target cairnd cairn cairn-offline
  tests/recordings/witness_test.sh build/release/bin build/recordings
}

# Root only: it makes a system of its own and boots it.
stage_systemd() {
  if [ "$(id -u)" -ne 0 ]; then echo "SKIPPED: not root"; return 77; fi
  deploy/install-packages.sh boot
  configure release
  build release --target cairnd cairn cairn-offline cairn-calibrate cairn-web
  tests/deploy/boot_systemd.sh build/release build/systemd
}

stage_studies() {
  configure release
  build release
  run_tests release -L study
}

passed=0 failed=0 skipped=0

# Adds up what ctest wrote about the stage, or the stage itself where it ran no tests.
count() { # exit code
  local code=$1 row tests bad left
  summary=$(tail -n 1 "$log")
  if [ -s "$logs/$stage.count" ]; then
    mapfile -t row <"$logs/$stage.count"
    tests=${row[0]} bad=${row[1]} left=${row[2]}
    summary="$tests tests"
    passed=$((passed + tests - bad - left)) failed=$((failed + bad)) skipped=$((skipped + left))
    [ "$left" -eq 0 ] || printf '   SKIPPED: %s\n' "${row[@]:3}"
    # A stage can fail besides its tests.
    [ "$code" -eq 0 ] || [ "$bad" -gt 0 ] || failed=$((failed + 1))
  else
    case $code in
      0) passed=$((passed + 1)) ;;
      77) skipped=$((skipped + 1)) ;;
      *) failed=$((failed + 1)) ;;
    esac
  fi
}

cache_use() {
  [ -s "$logs/$stage.ccache" ] || return 0
  CCACHE_STATSLOG=$logs/$stage.ccache ccache --show-log-stats 2>/dev/null | sed -n 's/^ *Hits: */, ccache hits /p' | head -n 1
}

finish() {
  printf '%s\n' "" "time: ${timings:-none} total ${SECONDS}s"
  echo "$passed passed, $failed failed, $skipped skipped"
}

group=
trap '[ -z "$group" ] || kill -TERM -- "-$group" 2>/dev/null; exit 143' INT TERM
timings=
for stage in "${stages[@]}"; do
  start=$SECONDS
  log=$logs/$stage.log
  rm -f "$logs/$stage.xml" "$logs/$stage.count" "$logs/$stage.ccache"
  echo "== $stage ..."
  # In a background shell, because a shell whose exit code is tested ignores `set -e`; in a process group of its own,
  # which ends with this script.
  set -m
  (
    set -e
    export CCACHE_STATSLOG=$logs/$stage.ccache
    "stage_$stage"
  ) >"$log" 2>&1 </dev/null &
  group=$!
  set +m
  code=0
  wait "$group" || code=$?
  took=$((SECONDS - start))
  timings+="$stage ${took}s, "
  count "$code"
  case $code in
    0)
      echo "   ok, ${took} s$(cache_use): $summary" ;;
    77) echo "   $(grep -m 1 '^SKIPPED' "$log" || echo "SKIPPED")" ;;
    *)
      tail -n 150 "$log"
      # The causes once more, where they are seen: a test that failed may have printed much after its own.
      grep -A 3 -e ': Failure$' -e 'runtime error: ' -e '^SUMMARY: ' -e 'does not hold' -e ' error: ' "$log" | tail -n 40 || true
      echo "FAILED in stage $stage after ${took} s; the whole output: ${log#"$root"/}"
      finish
      exit 1 ;;
  esac
done
finish
[ "$failed" -eq 0 ]
