#!/bin/sh
# Branch coverage of firmware/core by the Unity tests (tests/firmware), by gcovr. Fails below the bound.
# usage: scripts/firmware_coverage.sh [HTML_FILE]      (a page with every branch that no test takes)
#
# The compiler's own optimisation is off and the sanitizers are left to `pio test -e native`: both add and remove branches
# that nobody wrote. An assertion's other branch is one that no test can take. Generated code and the native board are run but not judged.
set -eu
cd "$(dirname "$0")/.."
least=95

build=build/firmware-coverage
unity=.pio/libdeps/native/Unity/src
[ -f "$unity/unity.c" ] || scripts/pio.sh pkg install --silent -e native
rm -rf "$build"
mkdir -p "$build"

flags="-std=c11 -O0 -g --coverage -Ifirmware/core -Ifirmware/generated -Ifirmware/boards/native -Itests/firmware -I$unity"
objects=
for source in firmware/core/*.c firmware/generated/*.c firmware/boards/native/*.c tests/firmware/*.c "$unity/unity.c"; do
    object=$build/$(basename "$source" .c).o
    # shellcheck disable=SC2086 # a list of options without spaces
    cc $flags -c "$source" -o "$object"
    objects="$objects $object"
done
for folder in tests/firmware/test_*/; do
    test=$(basename "$folder")
    # shellcheck disable=SC2086
    cc $flags "$folder"*.c $objects -lm -o "$build/$test"
    "$build/$test" >"$build/$test.log" || { cat "$build/$test.log" >&2; exit 1; }
done

[ $# -eq 0 ] || set -- --html-details "$1"
.venv/bin/gcovr --root . --filter firmware/core/ --txt - --txt-metric branch --print-summary \
    --exclude-branches-by-pattern '.*IMPID_ASSERT\(.*' --fail-under-branch "$least" "$@" "$build"
