#!/bin/sh
# Makes what Python needs of the IDL: the C headers of the messages, which messages.py reads, and a library with their
# descriptions for the DDS. Needs the packages cyclonedds-dev and cyclonedds-tools and a C compiler.
# Usage: client/python/build.sh [FOLDER]     (build/python if no folder is given)
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=${1:-$here/../../build/python}
mkdir -p "$out"
for name in geometry session scan odometry pose ledger; do
  idlc -l c -W no-implicit-extensibility -o "$out" "$here/../../idl/cairn/$name.idl"
done
cd "$out"
# Some linkers leave libddsc out without --no-as-needed, because the descriptions call none of its functions.
${CC:-cc} -shared -fPIC -o libcairn_messages.so ./*.c -Wl,--no-as-needed -lddsc
