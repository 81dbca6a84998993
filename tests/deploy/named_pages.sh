#!/usr/bin/env bash
# Whether the pages and scripts are installed that programs (in their help and their configuration), units, manual pages and
# other pages name:
#   named_pages.sh ROOT               in the system at ROOT
#   named_pages.sh --build BUILD_DIR  among what `cmake --install` installs
# A name such as client/sim/README.md is one in /usr/share/doc/PACKAGE, where PACKAGE is that of the file that says it.
set -euo pipefail

if [ "$1" = --build ]; then
  root=$(mktemp -d)
  trap 'rm -rf "$root"' EXIT
  for component in server client web; do DESTDIR=$root cmake --install "$2" --component $component --prefix /usr >/dev/null; done
else
  root=${1%/}
fi

missing=0 found=0
# The names in what is read, which SAYER says: look_for_names FOLDER SAYER. FOLDER is where relative names begin.
look_for_names() {
  local folder=$1 sayer=$2 name path
  while read -r name; do
    path=$folder/$name
    case $name in /*) path=$root$name ;; esac
    if [ -e "$path" ]; then found=$((found + 1)); else echo "$sayer names $name, and there is no $path"; missing=1; fi
  done < <(grep -oE '[A-Za-z0-9_./-]*[A-Za-z0-9_-]\.(md|sh)\b' | sort -u)
}
# The help of a program and of all its commands.
help_of() {
  local text word
  text=$("$@" --help)
  echo "$text"
  for word in $(awk '/^[^ ]/ { inside = /:$/ && !/^(Options|Positionals):/ } inside && /^  [a-z]/ { print $1 }' <<<"$text"); do
    help_of "$@" "$word"
  done
}
# Where the package that has a file has its pages.
doc_of() {
  case ${1##*/} in
    cairnd* | cairn-offline* | cairn-calibrate*) echo "$root/usr/share/doc/cairn-server" ;;
    cairn-web*) echo "$root/usr/share/doc/cairn-web" ;;
    *) echo "$root/usr/share/doc/cairn-client" ;;  # `cairn` has a manual page for each of its commands.
  esac
}

shopt -s nullglob
for file in "$root"/usr/bin/cairn*; do look_for_names "$(doc_of "$file")" "${file##*/} --help" < <(help_of "$file"); done
look_for_names "$(doc_of cairnd)" "cairnd --print-config" < <("$root/usr/bin/cairnd" --print-config)
for file in "$root"/usr/lib/systemd/system/cairn*.service "$root"/etc/cairn/*; do
  look_for_names "$(doc_of "$file")" "$file" <"$file"
done
for file in "$root"/usr/share/man/man?/cairn*.gz; do
  look_for_names "$(doc_of "$file")" "$file" < <(gzip -dc "$file" | sed 's/\\-/-/g')
done
# That names are found at all: there are some in the units, in the help of `cairn sim` and in the configuration.
if [ "$found" -lt 5 ]; then echo "only $found names were found"; missing=1; fi

# The links of the pages. What is left out is of use only with the sources.
for doc in "$root"/usr/share/doc/{cairn-server,cairn-client,cairn-web,libcairn-dev}; do
  [ -d "$doc" ] || continue
  while read -r page; do
    look_for_names "${page%/*}" "$page" < <(grep -oE '\]\([^():]+\.(md|sh)\)' "$page" | tr -d ']()' | grep -v '\btests/')
  done < <(find "$doc" -name '*.md')
done
exit $missing
