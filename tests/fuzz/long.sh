#!/usr/bin/env bash
# Runs the fuzz programs of the asan build for longer than their tests do, and prints a table of what they did.
#   tests/fuzz/long.sh SECONDS [TARGET...]     each target (all of them if none is named) for so many seconds
# Settings: CAIRN_JOBS (so many targets at once; 1), BUILD (build/asan). What is new is kept in BUILD/fuzz/TARGET, as
# after the tests; an input that fails in BUILD/fuzz/long/TARGET-*, and the output in BUILD/fuzz/long/TARGET.log. After a
# finding the target goes on for the rest of its time.
# Exit code: 0 nothing was found, 1 something was, 2 usage or a program is missing.
set -euo pipefail

usage() { sed -n '2,/^set/s/^# \{0,1\}//p' "$0" >&2; exit 2; }
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
cd "$root"
[[ ${1:-} =~ ^[1-9][0-9]*$ ]] || usage
seconds=$1
shift
build=${BUILD:-build/asan}
targets=("$@")
if [ ${#targets[@]} -eq 0 ]; then
  mapfile -t targets < <(find tests/fuzz -name '*_fuzz.cpp' -printf '%f\n' | sed 's/_fuzz\.cpp$//' | sort)
fi
for target in "${targets[@]}"; do
  [ -x "$build/tests/fuzz_$target" ] ||
    { echo "$build/tests/fuzz_$target is missing: tests/run.sh --stage fuzz builds it" >&2; exit 2; }
done

# As in run.sh.
fixed_layout=()
if setarch "$(uname -m)" -R true 2>/dev/null; then fixed_layout=(setarch "$(uname -m)" -R); fi
export ASAN_OPTIONS=detect_stack_use_after_return=1:strict_string_checks=1
export UBSAN_OPTIONS=print_stacktrace=1

kept=$build/fuzz/long
mkdir -p "$kept"

fuzz() { # target
  local target=$1 until=$((SECONDS + seconds)) findings=0 kind log=$kept/$1.log
  local grown=$build/fuzz/$target
  local arguments=(--seeds="$grown" -timeout=10 -rss_limit_mb=2048 -malloc_limit_mb=512 -print_final_stats=1)
  [ ! -e "tests/fuzz/dict/$target.dict" ] || arguments+=(-dict="tests/fuzz/dict/$target.dict")
  arguments+=("$grown")
  for kind in corpus regressions; do
    [ ! -d "tests/fuzz/$kind/$target" ] || arguments+=("tests/fuzz/$kind/$target")
  done
  mkdir -p "$grown"
  rm -f "$kept/$target"-*
  : >"$log"
  local left
  while left=$((until - SECONDS)) && [ "$left" -gt 0 ]; do
    "${fixed_layout[@]}" "$build/tests/fuzz_$target" -max_total_time="$left" -artifact_prefix="$kept/$target-" \
      "${arguments[@]}" >>"$log" 2>&1 && break
    findings=$((findings + 1))
    # What is found again at once, in the kept inputs, would be found for ever.
    [ $((until - SECONDS)) -lt $((left - 5)) ] || break
  done
  # Executions of all runs; the coverage (edges) of the last one.
  awk -v target="$target" -v findings="$findings" -v took="$((SECONDS - until + seconds))" '
    /^stat::number_of_executed_units/ { executions += $2 }
    / cov: / { for (i = 1; i < NF; ++i) if ($i == "cov:") coverage = $(i + 1) }
    END {
      if (took < 1) took = 1
      printf "| %s | %d | %d | %d | %d |\n", target, executions, executions / took, findings, coverage
    }' "$log" >"$kept/$target.row"
  [ "$findings" -eq 0 ] || echo "found: $(grep -h -m 1 -e 'ERROR:' -e 'does not hold' -e 'runtime error' "$log" || true)" >&2
}

running=0
for target in "${targets[@]}"; do
  [ "$running" -lt "${CAIRN_JOBS:-1}" ] || { wait -n; running=$((running - 1)); }
  fuzz "$target" &
  running=$((running + 1))
done
wait
echo "| target | executions | executions a second | findings | coverage (edges) |"
echo "|---|---|---|---|---|"
found=0
for target in "${targets[@]}"; do
  cat "$kept/$target.row"
  [ "$(awk -F'|' '{ print $5 + 0 }' "$kept/$target.row")" -eq 0 ] || found=1
done
exit "$found"
