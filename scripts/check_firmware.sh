#!/bin/sh
# Static checks of everything in C: format, warnings of both compilers as errors, cppcheck.
set -eu
cd "$(dirname "$0")/.."

for tool in clang-format cppcheck arm-none-eabi-gcc cc; do
    command -v "$tool" >/dev/null || {
        echo "check_firmware: $tool is missing; scripts/system_packages.sh names the packages" >&2
        exit 1
    }
done

ours=$(find hil_sim/plant hil_sim/board/elf firmware/core firmware/boards tests/firmware tests/firmware_fuzz tests/protocol -name '*.[ch]')
# shellcheck disable=SC2086 # a list of names without spaces
clang-format --style=file:firmware/.clang-format --dry-run --Werror $ours

warnings="-std=c11 -Wall -Wextra -Wconversion -Wshadow -Wundef -Werror -fsyntax-only -Ifirmware/core -Ifirmware/generated"
for source in firmware/core/*.c firmware/generated/*.c; do
    # shellcheck disable=SC2086
    arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb $warnings "$source"
done
for source in firmware/core/*.c firmware/generated/*.c firmware/boards/native/*.c tests/protocol/*.c hil_sim/plant/*.c hil_sim/board/elf/*.c; do
    # shellcheck disable=SC2086
    cc $warnings -Ifirmware/boards/native -Ihil_sim/plant "$source"
done

# Functions of the port and of the public interface are called from outside what cppcheck sees.
cppcheck --quiet --error-exitcode=1 --std=c11 --enable=warning,style,performance,portability --inline-suppr \
    --suppressions-list=firmware/cppcheck-suppressions.txt \
    -Ifirmware/core -Ifirmware/generated -Ifirmware/boards/native \
    firmware/core firmware/boards/native tests/protocol
