#!/bin/sh
# Static checks of the boards' code, and MISRA C:2012 with its deviations (firmware/misra-deviations.txt) and
# clang-tidy over core and boards.
set -eu
cd "$(dirname "$0")/.."

for tool in cppcheck clang-tidy arm-none-eabi-gcc; do
    command -v "$tool" >/dev/null || {
        echo "firmware_check: $tool is missing; scripts/system_packages.sh names the packages" >&2
        exit 1
    }
done

port=firmware/boards/stm32f446
for board in nucleo_f446re custom_f446re nucleo_f446re_adxl355; do
    includes="-Ifirmware/core -Ifirmware/generated -I$port -Ifirmware/boards/$board"
    for source in "$port"/*.c; do
        # shellcheck disable=SC2086 # a list of options without spaces
        arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -std=c11 -Wall -Wextra -Wconversion -Wshadow -Wundef -Werror \
            -fsyntax-only $includes "$source"
    done
    # Members that nobody names keep registers and stacked words at their offsets.
    # shellcheck disable=SC2086
    cppcheck --quiet --error-exitcode=1 --std=c11 --enable=warning,style,performance,portability --inline-suppr \
        --suppress=unusedStructMember \
        --suppressions-list=firmware/cppcheck-suppressions.txt $includes "$port"
done
# shellcheck disable=SC2086
cppcheck --quiet --error-exitcode=1 --std=c11 --addon=misra --inline-suppr \
    --suppressions-list=firmware/misra-deviations.txt $includes firmware/core "$port"

# clang brings its own compiler headers; newlib's stdatomic.h needs stdint.h before it with clang. The libc's are where the cross compiler looks for them.
libc=$(arm-none-eabi-gcc -xc -E -v /dev/null 2>&1 | sed -n 's|^ \(.*arm-none-eabi/include\)$|-isystem \1|p' | tr '\n' ' ')
# How many warnings it leaves out is all that it says there when all is well.
noise=$(mktemp)
trap 'rm -f "$noise"' EXIT
# shellcheck disable=SC2086
clang-tidy --quiet --config-file=firmware/.clang-tidy firmware/core/*.c "$port"/*.c -- \
    --target=arm-none-eabi -include stdint.h -mcpu=cortex-m4 -mthumb -std=c11 -Wall -Wextra $includes $libc \
    2>"$noise" || { cat "$noise" >&2; exit 1; }
echo "firmware_check: clean; $(grep -c '^misra' firmware/misra-deviations.txt) MISRA rules deviated from, each with its reason"
