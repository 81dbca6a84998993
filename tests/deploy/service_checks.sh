#!/usr/bin/env bash
# What a person checks of a new service, run inside the container that boot_systemd.sh boots: cairnd under systemd,
# from its first start to a configuration that is wrong. Exit code 1 where anything is not as it should be.
set -u
export PATH=/usr/local/bin:$PATH

failed=0
check() { # what, command
  local what=$1
  shift
  if "$@"; then echo "ok: $what"; else echo "FAILED: $what"; failed=1; fi
}
property() { systemctl show cairnd --property="$1" --value; }
journal() { journalctl --unit=cairnd --output=cat --quiet "$@"; }
journal_says() { journal "${@:2}" | grep -- "$1"; }
pid() { property MainPID; }
now_ms() { date +%s%3N; }
# Within so many seconds, or not at all: eventually SECONDS COMMAND
eventually() {
  local deadline=$((SECONDS + $1))
  shift
  until "$@"; do [ "$SECONDS" -lt "$deadline" ] || return 1; sleep 0.1; done
}
runs_anew() { [ "$(pid)" -ne 0 ] && [ "$(pid)" -ne "$1" ] && [ "$(property ActiveState)" = active ]; }
answers() { cairn ping --timeout 2s >/dev/null; }

# A system call that the unit forbids is an error to the server, which may not care; here it ends it.
mkdir -p /run/systemd/system/cairnd.service.d
printf '[Service]\nSystemCallErrorNumber=kill\n' \
  >/run/systemd/system/cairnd.service.d/walls.conf
systemctl daemon-reload

# A start returns when the server can be asked, not earlier.
check "systemctl start" systemctl start cairnd
check "it is active" systemctl is-active --quiet cairnd
[ "$(pid)" -ne 0 ] || exit 1  # Nothing below makes sense.
check "it answers at once" answers
# Active when it said so, not when it was begun: that takes it at least as long as to read its configuration.
to_active=$((($(property ActiveEnterTimestampMonotonic) - $(property ExecMainStartTimestampMonotonic)) / 1000))
check "active only when it said so, after $to_active ms" [ "$to_active" -ge 2 ]
check "its status is in words ($(property StatusText))" [ "$(property StatusText)" = "serving DDS domain 0" ]
systemctl status --no-pager --lines=0 cairnd | sed 's/^/   /'
user=$(stat -c %u "/proc/$(pid)")
check "a user made for it ($user)" [ "$user" -ge 61184 ]
check "its state directory" [ "$(stat -L -c '%u %a' /var/lib/cairn)" = "$user 750" ]
systemd-analyze security --no-pager cairnd | tail -n 1 | sed 's/^/   /'
check "exposure as running, at most 2.0" sh -c 'systemd-analyze security --no-pager --threshold=20 cairnd >/dev/null'

# It does its work inside its walls.
check "two robots drive, no scan is missing" \
  cairn sim --robots 2 --beams 180 --hz 10 --seconds 10 --rate 2 --site hall --watch-pid "$(pid)"
check "status" cairn status
check "a second server of the domain is refused" \
  sh -c 'timeout 10 cairnd --state none 2>&1 | grep -q "another server serves DDS domain"'
check "smoothing" cairn job smooth --site hall --wait
check "jobs step back behind the streams" \
  sh -c "cut -d ')' -f 2 /proc/$(pid)/task/*/stat | awk '\$17 > 0 { nice = 1 } END { exit !nice }'"
check "nothing it did was forbidden" [ "$(property NRestarts)" = 0 ]

# A server that hangs.
old=$(pid) began=$(now_ms)
kill -STOP "$old"
check "a stopped server is missed by the watchdog and started again" eventually 40 runs_anew "$old"
echo "   after $(($(now_ms) - began)) ms"
check "the journal says why" journal_says "Watchdog timeout"
check "no core file was left" sh -c '! ls /var/lib/cairn/core* 2>/dev/null'
check "it answers again" eventually 5 answers

# A server that dies.
old=$(pid) began=$(now_ms)
kill -KILL "$old"
check "a killed server is started again" eventually 10 runs_anew "$old"
echo "   after $(($(now_ms) - began)) ms, NRestarts=$(property NRestarts)"
check "it answers again" eventually 5 answers

# A server that somebody brings down again and again.
for _ in $(seq 12); do
  old=$(pid)
  kill -KILL "$old"
  eventually 10 runs_anew "$old" || break
done
check "after twelve more deaths it is still started again" eventually 5 answers

# A stop in the middle of work.
cairn sim --robots 4 --prefix load --beams 360 --hz 10 --seconds 600 --rate 20 --window 32 --site load >/run/load 2>&1 &
load=$!
load_is_on() { kill -0 "$load" && cairn status | grep -q ' in load: .*, connected'; }
check "four robots drive" eventually 10 load_is_on
sed "s/^/   /" /run/load
began=$(now_ms)
check "systemctl stop" systemctl stop cairnd
took=$(($(now_ms) - began))
check "stopped within 2 s under load ($took ms)" [ "$took" -lt 2000 ]
check "of its own accord ($(property Result), $(property ExecMainStatus))" [ "$(property Result) $(property ExecMainStatus)" = "success 0" ]
check "and said so" journal_says "Z info stopped; "
kill "$load" 2>/dev/null
wait "$load" 2>/dev/null

# A configuration that is wrong: one clear line, and no start after the other.
configuration=/usr/local/etc/cairn/cairnd.yaml
cp "$configuration" /run/cairnd.yaml
sed -i 's/^\( *publish_rate_hz:\) [0-9.]*/\1 4000/' "$configuration"
since=$(date '+%F %T')
check "a wrong configuration fails the start" sh -c '! systemctl start cairnd 2>/dev/null'
sleep 3  # That nothing happens can only be watched: much longer than RestartSec.
check "once" [ "$(property NRestarts) $(property ActiveState)" = "0 failed" ]
check "the journal names file, line and key" journal_says "cairnd.yaml:.*publish_rate_hz" --since="$since"
cp /run/cairnd.yaml "$configuration"
check "put right, it starts" systemctl start cairnd
check "and answers" answers

# What a site sets without touching files of ours.
echo CAIRN_DOMAIN=7 >/etc/default/cairnd
systemctl restart cairnd
check "/etc/default/cairnd moves it to another domain" cairn --domain 7 ping --timeout 2s
check "a clean stop while idle" systemctl stop cairnd
exit $failed
