#!/usr/bin/env bash
# `cmake --install` of the service, into a folder: install_test.sh BUILD_DIR
set -euo pipefail

build=$1
world=$(mktemp -d)
trap 'rm -rf "$world"' EXIT
status=0
check() { # what, command
  local what=$1
  shift
  if "$@"; then echo "ok: $what"; else echo "FAILED: $what"; status=1; fi
}
install() {
  local component
  for component in server web; do DESTDIR=$world cmake --install "$build" --component "$component" --prefix "$1" >/dev/null; done
}

# A unit configured for one prefix and installed under another named programs that were not there.
for pair in /usr:/etc /usr/local:/usr/local/etc; do
  prefix=${pair%:*} etc=${pair#*:}
  (umask 077 && install "$prefix")
  unit=$world$prefix/lib/systemd/system/cairnd.service
  check "under $prefix the unit starts what is installed there" \
    grep -qxF "ExecStart=$prefix/bin/cairnd --config $etc/cairn/cairnd.yaml" "$unit"
  check "under $prefix the page's unit too" grep -qF "ExecStart=$prefix/bin/cairn-web " "$world$prefix/lib/systemd/system/cairn-web.service"
  check "no placeholder is left" bash -c "! grep -q '@[A-Za-z_]*@' '$unit'"
  # The service's user is not root.
  check "a careful umask hides nothing from the service" \
    [ "$(stat -c %a "$world$etc/cairn" "$world$etc/cairn/cairnd.yaml" "$unit" | xargs)" = "755 644 644" ]
done

# A second installation once took back what somebody had set.
echo "wire: {domain: 5}" >"$world/etc/cairn/cairnd.yaml"
install /usr
check "a changed configuration stays" grep -q 'domain: 5' "$world/etc/cairn/cairnd.yaml"
check "the defaults of this version lie beside it" [ -s "$world/etc/cairn/cairnd.yaml.default" ]
exit $status
