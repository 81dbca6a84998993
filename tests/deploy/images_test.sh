#!/usr/bin/env bash
# Builds the images of deploy/containers/Dockerfile and runs what they start: images_test.sh PACKAGES_DIR TREE
# The Debian images that the Dockerfile begins from are made by debootstrap in the folder TREE the first time, so that no
# registry is asked. The Debian packages are those of PACKAGES_DIR, in place of the Dockerfile's stage `packages`, which
# would compile them once more (deploy/make-packages.sh). The server, asked by the health check of its image, the page and
# the discovery server must answer. Needs root, buildah, debootstrap and the package sources. Exit code: 77 where it cannot
# be done.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=tests/deploy/empty_system.sh
. "$here/empty_system.sh"
[ $# -eq 2 ] || { sed -n '2,8s/^# \{0,1\}//p' "$0" >&2; exit 2; }
packages=$(realpath "$1") tree=$(realpath -m "$2") root=$(cd "$here/../.." && pwd)
[ "$(id -u)" -eq 0 ] || skip "not root"
for tool in debootstrap buildah unshare; do command -v "$tool" >/dev/null || skip "no $tool on this machine"; done

# A network and processes of its own: nothing reaches another server, and all ends with this script.
if [ -z "${CAIRN_IMAGES_BUILT:-}" ]; then
  if empty_system "$tree" ""; then touch "$tree/complete"; fi
else
  ip link set lo up
fi

export BUILDAH_ISOLATION=chroot STORAGE_DRIVER=vfs
build=(buildah --root "$tree/store" --runroot "$tree/run")
if [ -z "${CAIRN_IMAGES_BUILT:-}" ]; then
  rm -rf "$tree/store" "$tree/run" "$tree/context"
  mkdir -p "$tree/context/packages"
  cp "$packages"/*.deb "$tree/context/packages/"
  base=$("${build[@]}" from scratch)
  "${build[@]}" add --quiet "$base" "$tree/root" / >"$tree/log" 2>&1
  for tag in 12 12-slim; do "${build[@]}" commit --quiet "$base" "docker.io/library/debian:$tag" >>"$tree/log" 2>&1; done
  "${build[@]}" rm "$base" >>"$tree/log" 2>&1
  for target in server web discovery; do
    start=$SECONDS
    "${build[@]}" bud --pull=never --network host --build-context "packages=$tree/context" --target "$target" \
      --tag "cairn-$target" --file "$root/deploy/containers/Dockerfile" "$root" >"$tree/log" 2>&1 ||
      { tail -n 30 "$tree/log"; echo "FAILED: the image $target is not built"; exit 1; }
    size=$("${build[@]}" images --format '{{.Size}}' "cairn-$target")
    echo "ok: the image $target is built ($((SECONDS - start)) s; $size with everything below it)"
  done
  CAIRN_IMAGES_BUILT=1 exec unshare --net --mount --pid --fork --kill-child --mount-proc "$0" "$packages" "$tree"
fi

failed=0
check() { # what, command
  local what=$1
  shift
  if "$@"; then echo "ok: $what"; else echo "FAILED: $what"; failed=1; fi
}
# Runs what the image starts, with further arguments, as the image's user: launch IMAGE CONTAINER [ARGUMENT]...
launch() {
  local image=$1 container=$2 words user
  shift 2
  mapfile -t words < <("${build[@]}" inspect --type image --format \
    '{{range .OCIv1.Config.Entrypoint}}{{println .}}{{end}}' "$image" | sed '/^$/d')
  user=$("${build[@]}" inspect --type image --format '{{.OCIv1.Config.User}}' "$image")
  "${build[@]}" run --network host --user "$user" --env CAIRN_INTERFACES=127.0.0.1 "$container" -- "${words[@]}" "$@" \
    >"$tree/$image.out" 2>&1
}
within() { # seconds, command: tried until it succeeds
  local end=$((SECONDS + $1))
  shift
  until "$@" >"$tree/asked" 2>&1; do
    [ "$SECONDS" -lt "$end" ] || { cat "$tree/asked"; return 1; }
    sleep 0.2
  done
}

server=$("${build[@]}" from cairn-server) web=$("${build[@]}" from cairn-web) discovery=$("${build[@]}" from cairn-discovery)
healthy() {
  "${build[@]}" run --network host --user 10001 --env CAIRN_INTERFACES=127.0.0.1 "$server" -- run-cairn cairn status --timeout 5
}
launch cairn-server "$server" &
launch cairn-web "$web" &
launch cairn-discovery "$discovery" -l 127.0.0.1 -p 11811 &
check "the server answers its health check" within 30 healthy
check "the server keeps its state where the volume is" "${build[@]}" run "$server" -- test -s /var/lib/cairn/cairn.db
check "the page answers its health check" within 30 \
  "${build[@]}" run --network host --user 10001 "$web" -- curl --fail --silent http://127.0.0.1:8420/healthz
page_sees_the_server() {
  "${build[@]}" run --network host --user 10001 "$web" -- curl --fail --silent http://127.0.0.1:8420/readyz
}
check "the page sees the server" within 30 page_sees_the_server
check "the discovery server listens" within 30 grep -qi ' 2E23 \|:2E23 ' /proc/net/udp
if [ "$failed" -ne 0 ]; then tail -n 20 "$tree"/cairn-*.out; fi
exit "$failed"
