#!/usr/bin/env bash
# The long forms of the recording's tests, one after the other; about an hour. Writes docs/validation/recording.md.
set -euo pipefail
cd "$(dirname "$0")/.."

for part in kill disk day noise load can_loggers; do
  echo "== $part"
  python "bench/recording/$part.py"
done
python bench/recording/report.py
