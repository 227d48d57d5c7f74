#!/bin/sh
# The fuzz targets of tests/firmware_fuzz (libFuzzer with address and undefined-behaviour sanitizers).
# usage: scripts/firmware_fuzz.sh [-runs=N | -max_total_time=SECONDS] [more libFuzzer options]
#        for each target; without one of these 20000 runs from a fixed seed, the same ones every time
#
# A failing input is left in build/firmware-fuzz/. What a long run finds beyond the committed seeds stays in build/
# too, and is where the next long run goes on.
set -eu
cd "$(dirname "$0")/.."
build=build/firmware-fuzz
mkdir -p "$build"
sanitizers=-fsanitize=fuzzer,address,undefined
if ! echo 'int LLVMFuzzerTestOneInput(const char *d, unsigned long n) { return d == 0 && n; }' |
    clang -xc -o "$build/probe" $sanitizers - 2>"$build/probe.log"; then
    cat "$build/probe.log" >&2
    echo "firmware_fuzz: clang or its runtime library is missing; scripts/system_packages.sh names the packages" >&2
    exit 1
fi

long=$*
[ $# -gt 0 ] || set -- -runs=20000 -seed=1
total=0
flags="-std=c11 -O1 -g $sanitizers -fno-sanitize-recover=all -Wall -Wextra -Werror -Ifirmware/core -Ifirmware/generated -Itests/firmware_fuzz"
objects=
for source in firmware/core/*.c firmware/generated/*.c; do
    object=$build/$(basename "$source" .c).o
    # shellcheck disable=SC2086 # a list of options without spaces
    clang $flags -c "$source" -o "$object"
    objects="$objects $object"
done
for target in frame command settings; do
    # shellcheck disable=SC2086
    clang $flags "tests/firmware_fuzz/fuzz_$target.c" $objects -o "$build/$target"
    corpus=$build/corpus-$target
    [ -n "$long" ] || corpus=$(mktemp -d)
    mkdir -p "$corpus"
    log=$build/$target.log
    "$build/$target" -artifact_prefix="$build/$target-" -print_final_stats=1 "$@" \
        "$corpus" "tests/firmware_fuzz/seeds/$target" >"$log" 2>&1 || { tail -n 40 "$log" >&2; exit 1; }
    [ -n "$long" ] || rm -r "$corpus"
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    echo "firmware_fuzz: $target: $runs executions, no failure"
    total=$((total + runs))
done
echo "firmware_fuzz: $total executions in all"
