#!/usr/bin/env bash
# How many compilers may run at once: as many as there are processors, but each may take 1.5 GiB of what memory is free.
set -euo pipefail
memory_jobs=$(awk '/^MemAvailable/ { jobs = int($2 / 1572864); print jobs < 1 ? 1 : jobs }' /proc/meminfo)
processors=$(nproc)
echo $((processors < memory_jobs ? processors : memory_jobs))
