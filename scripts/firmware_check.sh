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

# What both chips have, and the port of each.
both=firmware/boards/stm32
first=firmware/boards/stm32f446
second=firmware/boards/stm32g474
ours="-Ifirmware/core -Ifirmware/generated"
f446="$ours -I$first -I$both -Ifirmware/boards/nucleo_f446re_adxl355"
g474="$ours -I$second -I$both -Ifirmware/boards/nucleo_g474re"

# shellcheck disable=SC2086 # a list of names without spaces
check_port() { # SOURCES INCLUDES...
    sources=$1
    shift
    for source in $sources; do
        arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -std=c11 -Wall -Wextra -Wconversion -Wshadow -Wundef -Werror \
            -fsyntax-only "$@" "$source"
    done
    # Members that nobody names keep registers and stacked words at their offsets.
    cppcheck --quiet --error-exitcode=1 --std=c11 --enable=warning,style,performance,portability --inline-suppr \
        --suppress=unusedStructMember \
        --suppressions-list=firmware/cppcheck-suppressions.txt "$@" $sources
}

# shellcheck disable=SC2086 # lists of options without spaces
{
    for board in nucleo_f446re custom_f446re; do
        check_port "$first/*.c $both/*.c" $ours -I$first -I$both -Ifirmware/boards/$board
    done
    check_port "$first/*.c $both/*.c" $f446
    check_port "$second/*.c $both/*.c" $g474
    misra="cppcheck --quiet --error-exitcode=1 --std=c11 --addon=misra --inline-suppr"
    $misra --suppressions-list=firmware/misra-deviations.txt $f446 firmware/core "$first" "$both"
    $misra --suppressions-list=firmware/misra-deviations.txt $g474 $second/*.c $both/*.c
}

# clang brings its own compiler headers; newlib's stdatomic.h needs stdint.h before it with clang. The libc's are where the cross compiler looks for them.
libc=$(arm-none-eabi-gcc -xc -E -v /dev/null 2>&1 | sed -n 's|^ \(.*arm-none-eabi/include\)$|-isystem \1|p' | tr '\n' ' ')
# How many warnings it leaves out is all that it says there when all is well.
noise=$(mktemp)
trap 'rm -f "$noise"' EXIT
tidy() { # INCLUDES SOURCES...
    includes=$1
    shift
    # shellcheck disable=SC2086
    clang-tidy --quiet --config-file=firmware/.clang-tidy "$@" -- \
        --target=arm-none-eabi -include stdint.h -mcpu=cortex-m4 -mthumb -std=c11 -Wall -Wextra $includes $libc \
        2>"$noise" || { cat "$noise" >&2; exit 1; }
}
tidy "$f446" firmware/core/*.c "$first"/*.c "$both"/*.c
tidy "$g474" "$second"/*.c "$both"/*.c
echo "firmware_check: clean; $(grep -c '^misra' firmware/misra-deviations.txt) MISRA rules deviated from, each with its reason"
