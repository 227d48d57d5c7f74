#!/bin/sh
# Builds the firmware of every board and judges sizes and stack against the budgets.
# ELF and map: .pio/build/<board>/firmware.{elf,map}
set -eu
cd "$(dirname "$0")/.."
command -v arm-none-eabi-gcc >/dev/null || {
    echo "firmware_build: arm-none-eabi-gcc is missing; scripts/system_packages.sh names the packages" >&2
    exit 1
}
boards="nucleo_f446re custom_f446re nucleo_f446re_adxl355 nucleo_g474re"
for board in $boards; do
    scripts/pio.sh run --silent -e "$board"
done
# shellcheck disable=SC2086 # a list of names without spaces
.venv/bin/python scripts/firmware_budget.py $boards
