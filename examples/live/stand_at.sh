#!/usr/bin/env bash
# Says once a second where a device is, as a locating system would; Ctrl-C ends it.
#   ./stand_at.sh worker 3.0 -3.3      x and y in metres of the site frame, and how far off that may be (1 m)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
[ $# -ge 3 ] || { echo "stand_at.sh: give a device, x and y" >&2; exit 2; }
command -v mosquitto_pub >/dev/null || { echo "stand_at.sh: sudo apt-get install mosquitto-clients" >&2; exit 2; }
[ -s run/locator.password ] || { echo "stand_at.sh: start ./up.sh first" >&2; exit 2; }

# mosquitto_pub reads its account from there, so that no list of processes shows the password.
umask 077
mkdir -p run/locator
printf -- '-u locator\n-P %s\n' "$(cat run/locator.password)" >run/locator/mosquitto_pub
while printf '{"x_m": %s, "y_m": %s, "sigma_m": %s}\n' "$2" "$3" "${4:-1.0}"; do sleep 1; done |
  XDG_CONFIG_HOME=run/locator mosquitto_pub -V 5 -h 127.0.0.1 -p 1884 -l -t "standoff/example/device/$1/position"
