#!/bin/sh
# Builds the firmware of every board and prints its sizes against the budgets.
# Usage: scripts/firmware_build.sh [board ...]     ELF and map: build/firmware/<board>/
set -eu
cd "$(dirname "$0")/.."
command -v arm-none-eabi-gcc >/dev/null || {
    echo "arm-none-eabi-gcc is missing; on Debian: sudo apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi" >&2
    exit 1
}
PORT=firmware/boards/stm32f446
CPU="-mcpu=cortex-m4 -mthumb -mfloat-abi=soft"
FLAGS="-std=c11 -Os -g -ffunction-sections -fdata-sections -fno-common -fstack-usage -Wall -Wextra -Wconversion -Werror"
for board in ${*:-nucleo_f446re custom_f446re}; do
    out=build/firmware/$board
    rm -rf "$out"
    mkdir -p "$out"
    for source in firmware/core/*.c firmware/generated/*.c $PORT/*.c; do
        arm-none-eabi-gcc $CPU $FLAGS -Ifirmware/core -Ifirmware/generated -I$PORT -Ifirmware/boards/"$board" \
            -c "$source" -o "$out/$(basename "$source" .c).o"
    done
    arm-none-eabi-gcc $CPU -nostartfiles --specs=nano.specs -Wl,--gc-sections,--fatal-warnings,-Map="$out/firmware.map" \
        -T $PORT/stm32f446.ld "$out"/*.o -o "$out/firmware.elf"
    arm-none-eabi-size -A "$out/firmware.elf" | head -8
done
