#!/bin/sh
# PlatformIO with its tools inside this checkout: scripts/pio.sh test -e native
set -eu
cd "$(dirname "$0")/.."
# One at a time, where the system has flock: two runs in one build folder undo each other's work.
if command -v flock >/dev/null; then
    mkdir -p .pio
    exec 9>.pio/lock
    flock 9
fi
scripts/pio_bootstrap.sh
export PLATFORMIO_CORE_DIR="${PLATFORMIO_CORE_DIR:-$PWD/.pio-core}"
export PLATFORMIO_SETTING_ENABLE_TELEMETRY=no PLATFORMIO_SETTING_CHECK_PLATFORMIO_INTERVAL=9999
exec .venv/bin/pio "$@"
