#!/usr/bin/env bash
# Prints how many compilers may run at once: one per processor, but not more than the free memory allows at
# 1.5 GiB each.
set -euo pipefail
memory_jobs=$(awk '/^MemAvailable/ { jobs = int($2 / 1572864); print jobs < 1 ? 1 : jobs }' /proc/meminfo)
processors=$(nproc)
echo $((processors < memory_jobs ? processors : memory_jobs))
