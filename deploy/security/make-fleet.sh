#!/usr/bin/env bash
# Makes what a fleet needs for DDS Security: a certificate authority (CA), and a directory for the server and for every
# robot, viewer, recorder and operator, to be named by the option wire.security of `cairnd` and `cairn`.
# Usage: make-fleet.sh DIR [--robots NAMES] [--viewers NAMES] [--recorders NAMES] [--operators NAMES] [--days N]
# NAMES are separated by commas. A robot `sim=r1+r2` is one program that drives the robots r1 and r2.
# Output: DIR/ca.key (the secret of the fleet; keep it away from the robots), DIR/ca.pem, DIR/server, and DIR/robots/NAME,
# DIR/viewers/NAME and so on. If DIR has a CA already, that CA is used, and existing members stay as they are.
# To renew a member, or to change the robots of `sim`, delete its directory and run the script again.
# Certificates and permissions are valid for N days (365), the CA for ten times as long.
# Exit codes: 0 made, 1 openssl failed, 2 wrong usage.
set -euo pipefail -o noglob

usage() { sed -n '2,11s/^# \{0,1\}//p' "${BASH_SOURCE[0]}" >&2; exit 2; }
fail() { echo "make-fleet: $*" >&2; exit "${code:-1}"; }

dir=
robots=
viewers=
recorders=
operators=
days=365
while [ $# -gt 0 ]; do
  case $1 in
    --robots | --viewers | --recorders | --operators | --days)
      [ $# -ge 2 ] || usage
      printf -v "${1#--}" %s "$2"
      shift 2
      ;;
    -*) usage ;;
    *)
      [ -z "$dir" ] || usage
      dir=$1
      shift
      ;;
  esac
done
[ -n "$dir" ] || usage
[[ $days =~ ^[1-9][0-9]{0,4}$ ]] || code=2 fail "--days: '$days' is not a number of days"
[[ ! $robots$viewers$recorders$operators =~ [[:space:]] ]] || code=2 fail "names must not contain spaces"
# The same names as everywhere in Cairn. In particular they contain nothing that XML or the shell would interpret.
for name in ${robots//[,=+]/ } ${viewers//,/ } ${recorders//,/ } ${operators//,/ }; do
  [[ $name =~ ^[A-Za-z0-9_][A-Za-z0-9._-]{0,63}$ ]] ||
    code=2 fail "'$name' is not a name (1 to 64 of A-Z a-z 0-9 . _ -, not starting with . or -)"
done
command -v openssl >/dev/null || fail "openssl is not installed: deploy/install-packages.sh build"

umask 077  # Keys are readable by their owner only.
mkdir -p "$dir"
cd "$dir"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
run() { "$@" >"$scratch/said" 2>&1 || { cat "$scratch/said" >&2; fail "this command failed: $*"; }; }

new_key() { run openssl ecparam -name prime256v1 -genkey -noout -out "$1"; }
sign() { run openssl smime -sign -in "$1" -text -out "$2" -signer ca.pem -inkey ca.key; }
moment() { date -u -d "$1" +%Y-%m-%dT%H:%M:%S; }

if [ ! -e ca.key ]; then
  new_key "$scratch/ca.key"
  run openssl req -x509 -new -key "$scratch/ca.key" -subj "/O=cairn/CN=fleet CA $(openssl rand -hex 4)" \
    -days $((days * 10)) -out ca.pem
  mv "$scratch/ca.key" ca.key
fi

# The rules that all members share. Whoever has no identity of this fleet is refused. Discovery and samples are
# encrypted with keys that a writer gives only to the readers that the permissions allow; every message is signed, but
# Fast DDS 2.9 also accepts unsigned ones.
if [ ! -e governance.smime ]; then
  cat >"$scratch/governance.xml" <<XML
<?xml version="1.0" encoding="UTF-8"?>
<dds><domain_access_rules><domain_rule>
<domains><id_range><min>0</min><max>232</max></id_range></domains>
<allow_unauthenticated_participants>false</allow_unauthenticated_participants>
<enable_join_access_control>true</enable_join_access_control>
<discovery_protection_kind>ENCRYPT</discovery_protection_kind>
<liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
<rtps_protection_kind>SIGN</rtps_protection_kind>
<topic_access_rules><topic_rule><topic_expression>*</topic_expression>
<enable_discovery_protection>true</enable_discovery_protection>
<enable_liveliness_protection>true</enable_liveliness_protection>
<enable_read_access_control>true</enable_read_access_control>
<enable_write_access_control>true</enable_write_access_control>
<metadata_protection_kind>NONE</metadata_protection_kind>
<data_protection_kind>ENCRYPT</data_protection_kind>
</topic_rule></topic_access_rules>
</domain_rule></domain_access_rules></dds>
XML
  sign "$scratch/governance.xml" governance.smime
fi

elements() { # tag, values
  local tag=$1
  shift
  printf "<$tag>%s</$tag>" "$@"
}
topics() { printf '<topics>'; elements topic "${@/#/cairn\/v1\/}"; printf '</topics>'; }
rule() { printf '<allow_rule><domains><id_range><min>0</min><max>232</max></id_range></domains>%s</allow_rule>\n' "$*"; }
told=(session_state session_refusal pose ledger map tile job) # Topics that the server writes and every member may read.
replies=$(printf '<subscribe>'; topics reply; printf '<partitions><partition>reply.*</partition></partitions></subscribe>')

rules_of_server() {
  local all='<topics><topic>cairn/v1/*</topic></topics><partitions><partition>*</partition></partitions>'
  rule "<publish>$all</publish><subscribe>$all</subscribe>"
}
rules_of_robot() { # the robots' names, separated by +
  # The partition of a stream is the robot's name. Each in a rule of its own: within a rule, any partition would do for
  # any topic.
  rule "<publish>$(topics session scan odometry)<partitions>$(elements partition ${1//+/ })</partitions></publish>"
  rules_of_viewer
}
rules_of_viewer() {
  rule "<publish>$(topics request)</publish><subscribe>$(topics "${told[@]}")</subscribe>"
  rule "$replies"
}
rules_of_recorder() { # What all robots send, besides.
  rule "<subscribe>$(topics scan odometry)<partitions><partition>*</partition></partitions></subscribe>"
  rules_of_viewer
}
rules_of_operator() {
  rule "<publish>$(topics request command)</publish><subscribe>$(topics "${told[@]}")</subscribe>"
  rule "$replies"
}

member() { # role, name, rules, directory
  local role=$1 name=$2 rules=$3 place=$4
  if [ -e "$place" ]; then
    echo "$place stays as it is"
    return
  fi
  local new=$scratch/new
  rm -rf "$new"
  mkdir "$new"
  new_key "$new/key.pem"
  run openssl req -new -key "$new/key.pem" -subj "/O=cairn/OU=$role/CN=$name" -out "$scratch/request"
  # A member must not sign permissions, although its certificate comes from the CA that signs them.
  printf 'basicConstraints=critical,CA:FALSE\nextendedKeyUsage=critical,clientAuth,serverAuth\n' >"$scratch/extensions"
  run openssl x509 -req -extfile "$scratch/extensions" -in "$scratch/request" -CA ca.pem -CAkey ca.key -set_serial "0x$(openssl rand -hex 16)" \
    -days "$days" -out "$new/cert.pem"
  {
    echo '<?xml version="1.0" encoding="UTF-8"?>'
    echo "<dds><permissions><grant name=\"$role-$name\"><subject_name>CN=$name,OU=$role,O=cairn</subject_name>"
    echo "<validity><not_before>$(moment '-1 day')</not_before><not_after>$(moment "+$((days + 1)) days")</not_after></validity>"
    echo "$rules<default>DENY</default></grant></permissions></dds>"
  } >"$scratch/permissions.xml"
  sign "$scratch/permissions.xml" "$new/permissions.smime"
  cp ca.pem "$new/identity_ca.pem"
  cp governance.smime "$new/"
  mkdir -p "$(dirname "$place")"
  mv "$new" "$place"
  echo "$place made, valid for $days days"
}

member server server "$(rules_of_server)" server
for robot in ${robots//,/ }; do
  member robot "${robot%%=*}" "$(rules_of_robot "${robot#*=}")" "robots/${robot%%=*}"
done
for viewer in ${viewers//,/ }; do member viewer "$viewer" "$(rules_of_viewer)" "viewers/$viewer"; done
for recorder in ${recorders//,/ }; do member recorder "$recorder" "$(rules_of_recorder)" "recorders/$recorder"; done
for operator in ${operators//,/ }; do member operator "$operator" "$(rules_of_operator)" "operators/$operator"; done
