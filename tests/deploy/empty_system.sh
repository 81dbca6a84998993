# Sourced by the tests that need a system of their own.

skip() { echo "SKIPPED: $*"; exit 77; }

# Makes a small system like this machine's (Debian or Ubuntu) in TREE/root, unless it was completed there before:
# empty_system TREE PACKAGES, then `touch TREE/complete` when what the test adds is in it. Returns 1 where it is complete.
# A minute and 300 MB. PACKAGES: comma-separated, installed besides; may be empty.
empty_system() {
  local tree=$1 packages=$2 codename distribution components=main
  [ ! -e "$tree/complete" ] || return 1
  # shellcheck disable=SC1091
  read -r codename distribution < <(. /etc/os-release && echo "$VERSION_CODENAME $ID")
  [ "$distribution" != ubuntu ] || components=main,universe
  rm -rf "$tree"
  mkdir -p "$tree"
  echo "making $tree"
  debootstrap --variant=minbase --components="$components" ${packages:+--include="$packages"} "$codename" "$tree/root" \
    >"$tree/log" 2>&1 || skip "debootstrap failed: $(tail -n 1 "$tree/log")"
}

# An overlay over TREE/root at /run/root, gone with the mount namespace of the caller.
enter_overlay() {
  local tree=$1
  mount -t tmpfs -o mode=755 tmpfs /run
  mkdir -p /run/over/{upper,work} /run/root
  mount -t overlay -o "lowerdir=$tree/root,upperdir=/run/over/upper,workdir=/run/over/work" overlay /run/root
}
