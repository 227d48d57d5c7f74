#!/usr/bin/env bash
# The long forms of the recording's tests, one after the other; about four hours, one of them in real time.
# Writes docs/validation/recording.md. LSL takes part where pylsl is installed: pip install 'impid[bench]'.
set -euo pipefail
cd "$(dirname "$0")/.."

run() {
  echo "== $*"
  python "bench/recording/$1.py" "${@:2}"
}

for carrier in pty tcp slcan udp_multicast; do run faults "$carrier"; done
run kill
run kill 40 stalled
run disk
run day
run day_file
run noise
for carrier in serial slcan udp_multicast; do run load "$carrier"; done
run stamps
run can_loggers
python bench/recording/report.py
