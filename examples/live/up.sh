#!/usr/bin/env bash
# A site that is watched live, on this machine alone: broker, drone, service. Ctrl-C ends all of it.
#   ./up.sh              says how two receivers are opened in two more terminals
#   ./up.sh --wearables  opens them here, side by side, where there is tmux
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
here=$PWD
run=$here/run
film=$here/../../src/standoff/demo/video.mp4
PATH=$PATH:/usr/sbin:/sbin # Debian keeps servers there; users do not look there.

fail() {
  echo "up.sh: $*" >&2
  exit 2
}

case "${1:-}" in
  "") with_wearables= ;;
  --wearables) with_wearables=yes ;;
  *) fail "no option $1; there is --wearables" ;;
esac

need() { # a program, the packages that bring it
  command -v "$1" >/dev/null || fail "$1 is missing: sudo apt-get install $2"
}
need mosquitto mosquitto
need mosquitto_passwd mosquitto
need nginx "nginx-light libnginx-mod-rtmp"
need ffmpeg ffmpeg
[ -e /usr/lib/nginx/modules/ngx_rtmp_module.so ] || fail "nginx cannot take RTMP: sudo apt-get install libnginx-mod-rtmp"
[ -f "$film" ] || fail "no film at $film: start it where it lies, in a clone of standoff"

standoff=${STANDOFF:-}
[ -n "$standoff" ] || standoff=$here/../../.venv/bin/standoff
[ -x "$standoff" ] || standoff=$(command -v standoff) || fail "standoff is missing: pip install '.[serve]'"
standoff=$(realpath "$standoff")

for port in 1884 1936; do
  (: <>"/dev/tcp/127.0.0.1/$port") 2>/dev/null && fail "port $port is taken: is another up.sh running?"
done

umask 077
mkdir -p "$run"
rm -f "$run"/*.log "$run/passwd"
for account in service foreman operator worker locator watcher; do
  [ -s "$run/$account.password" ] || head -c 24 /dev/urandom | base64 >"$run/$account.password"
  echo "$account:$(cat "$run/$account.password")" >>"$run/passwd"
done
mosquitto_passwd -U "$run/passwd" # Only what cannot be turned back stays in it.

names=() pids=()
start() { # a name, a command; in a session of its own: Ctrl-C is for this script, which ends all in order
  local name=$1
  shift
  setsid "$@" </dev/null >>"$run/$name.log" 2>&1 &
  names+=("$name") pids+=("$!")
}

end_all() {
  trap - EXIT
  trap '' INT TERM HUP
  [ ${#pids[@]} -eq 0 ] || echo "Ending ..."
  local k
  for ((k = ${#pids[@]} - 1; k >= 0; k--)); do # last in, first out: the service first
    kill -TERM "${pids[k]}" 2>/dev/null || continue
    for _ in $(seq 150); do
      kill -0 "${pids[k]}" 2>/dev/null || continue 2
      sleep 0.1
    done
    echo "up.sh: ${names[k]} did not end; killed" >&2
    kill -KILL "${pids[k]}" 2>/dev/null || true
  done
}
trap end_all EXIT
trap 'exit 0' INT TERM HUP

listens() { # on a port, within five seconds
  for _ in $(seq 50); do
    (: <>"/dev/tcp/127.0.0.1/$1") 2>/dev/null && return
    sleep 0.1
  done
  return 1
}

start mosquitto mosquitto -c mosquitto.conf
listens 1884 || fail "mosquitto does not start: $(tail -n 1 "$run/mosquitto.log")"
start nginx nginx -p "$run" -c "$here/nginx.conf" -e "$run/nginx.log"
listens 1936 || fail "nginx does not start: $(tail -n 1 "$run/nginx.log")"
start drone ffmpeg -nostdin -loglevel warning -re -stream_loop -1 -i "$film" -c copy -an -f flv rtmp://127.0.0.1:1936/live/drone
start service "$standoff" serve site.yaml

wearable() { # a device; the command that is its receiver
  echo "$standoff wearable --device $1 --site example --broker mqtt://127.0.0.1:1884 --user $1 --password file:$run/$1.password"
}

status=
for _ in $(seq 300); do
  status=$(sed -n 's/^Status: //p' "$run/service.log")
  [ -n "$status" ] && break
  kill -0 "${pids[-1]}" 2>/dev/null || fail "the service does not start: $(tail -n 1 "$run/service.log")"
  sleep 0.1
done
echo "The drone flies, the service watches. The status page:"
echo "  ${status:-not there yet; see $run/service.log}"
! grep -q '"no page; ' "$run/service.log" || echo "  (no pages are built: make page; numbers are at http://127.0.0.1:8765/metrics)"

if [ -n "$with_wearables" ] && command -v tmux >/dev/null && [ -t 0 ]; then
  unset TMUX
  tmux -L standoff-live new-session -d -s example "$(wearable foreman)"
  tmux -L standoff-live split-window -h -t example "$(wearable operator)"
  echo "Enter acknowledges in the pane that you are in; Ctrl-b and an arrow go to the other. When both have ended, all ends."
  sleep 3
  tmux -L standoff-live attach -t example || true
  tmux -L standoff-live kill-server 2>/dev/null || true
  exit 0
fi
[ -z "$with_wearables" ] || echo "(No tmux, or no terminal: open them yourself.)"
echo
echo "In a second terminal, the foreman's receiver:"
echo "  $(wearable foreman)"
echo "In a third one, the operator's:"
echo "  $(wearable operator)"
echo
echo "Logs are in $run. A machine that sees standoff for the first time compiles for a minute before it measures."
echo "Ctrl-C ends all."

while sleep 0.5; do
  for k in "${!pids[@]}"; do
    kill -0 "${pids[k]}" 2>/dev/null || fail "${names[k]} has ended: $(tail -n 1 "$run/${names[k]}.log")"
  done
done
