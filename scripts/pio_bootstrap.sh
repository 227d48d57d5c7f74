#!/bin/sh
# Lay PlatformIO's own tools into the project where its registry cannot be reached.
#
# Where the registry answers, nothing is done: PlatformIO fetches what it needs by itself. Elsewhere its
# build tool SCons comes from the Python package index, Unity from Debian's source package cjson, which
# carries it for its own tests, and for its platform ststm32 and that platform's compiler firmware/pio/ststm32 stands
# in, with the compiler that the system has. Everything goes to .pio-core/ and .pio/ of this checkout; the user's own
# PlatformIO home and the system's package sources stay as they are.
#
# PlatformIO wants Unity in every environment of a project that has tests, even where none is run.
# usage: scripts/pio_bootstrap.sh [ENVIRONMENT...]      (default: all of platformio.ini)
set -eu

cd "$(dirname "$0")/.."
root=$PWD
export PLATFORMIO_CORE_DIR="${PLATFORMIO_CORE_DIR:-$root/.pio-core}"
export PLATFORMIO_SETTING_ENABLE_TELEMETRY=no PLATFORMIO_SETTING_CHECK_PLATFORMIO_INTERVAL=9999
bin=$root/.venv/bin
environments=${*:-native qemu_cortex_m4 nucleo_f446re custom_f446re nucleo_f446re_adxl355 nucleo_g474re}

# PlatformIO 6 accepts only its own numbering of SCons: 4.41101.0 is 4.11.1.
scons=4.11.1
scons_package=4.41101.0
unity_package=2.6.1
compiler_package=1.120301.0 # by name: which one it is, the system decides

scons_folder=$PLATFORMIO_CORE_DIR/packages/tool-scons
unity_source=$PLATFORMIO_CORE_DIR/unity

registry_answers() {
    timeout 10 "$bin/pio" pkg show platformio/tool-scons >/dev/null 2>&1
}

lay_scons() {
    echo "bootstrap: SCons $scons from the Python package index"
    rm -rf "$scons_folder"
    "$bin/python" -m pip install --quiet --disable-pip-version-check --no-deps --target "$scons_folder" "scons==$scons"
    printf '%s\n' 'from SCons.Script.Main import main' '' 'main()' >"$scons_folder/scons.py"
    printf '{"name": "tool-scons", "version": "%s", "description": "SCons"}\n' "$scons_package" \
        >"$scons_folder/package.json"
    printf '{"type": "tool", "name": "tool-scons", "version": "%s", "spec": {"owner": "platformio", "id": 8192, "name": "tool-scons", "requirements": null, "uri": null}}\n' \
        "$scons_package" >"$scons_folder/.piopm"
}

# The system's own sources, as sources of source packages, in a folder of ours.
derive_sources() {
    for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.list; do
        [ -f "$file" ] && sed -n 's/^[[:space:]]*deb[[:space:]]/deb-src /p' "$file" >"$1/$(basename "$file" .list).list"
    done
    for file in /etc/apt/sources.list.d/*.sources; do
        [ -f "$file" ] && sed 's/^Types:.*/Types: deb-src/' "$file" >"$1/$(basename "$file")"
    done
    return 0
}

fetch_unity() {
    echo "bootstrap: Unity from the source package cjson"
    command -v apt-get >/dev/null || {
        echo "bootstrap: neither PlatformIO's registry nor apt-get can be reached: no Unity for the firmware tests" >&2
        return 1
    }
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
    mkdir -p "$work/sources.list.d" "$work/lists/partial" "$work/cache/archives/partial" "$work/source"
    derive_sources "$work/sources.list.d"
    set -- -o "Dir::Etc::sourcelist=/dev/null" -o "Dir::Etc::sourceparts=$work/sources.list.d" \
        -o "Dir::State::lists=$work/lists" -o "Dir::Cache=$work/cache" -o "APT::Sandbox::User=$(id -un)"
    # One unreachable source among several is no reason to stop: the download decides.
    apt-get "$@" -qq update || true
    (cd "$work/source" && apt-get "$@" -qq source --download-only cjson) || {
        echo "bootstrap: 'apt-get source cjson' failed: no Unity for the firmware tests" >&2
        return 1
    }
    mkdir -p "$work/unpacked"
    tar -xf "$work"/source/cjson_*.orig.tar.* -C "$work/unpacked" --strip-components=1
    rm -rf "$unity_source"
    mkdir -p "$unity_source/src" "$unity_source/examples"
    cp "$work"/unpacked/tests/unity/src/*.[ch] "$unity_source/src/"
    cp "$work"/unpacked/tests/unity/examples/unity_config.h "$unity_source/examples/"
    printf '{"name": "Unity", "version": "%s", "build": {"srcDir": "src", "flags": ["-I src"]}, "frameworks": "*", "platforms": "*"}\n' \
        "$unity_package" >"$unity_source/library.json"
    printf '{"type": "library", "name": "Unity", "version": "%s", "spec": {"owner": "throwtheswitch", "id": null, "name": "Unity", "requirements": null, "uri": null}}\n' \
        "$unity_package" >"$unity_source/.piopm"
}

# Laid anew each time: it is small, and the checkout's may have changed.
lay_ststm32() {
    platform=$PLATFORMIO_CORE_DIR/platforms/ststm32
    compiler=$PLATFORMIO_CORE_DIR/packages/toolchain-gccarmnoneeabi
    version=$(sed -n 's/^  "version": "\(.*\)",$/\1/p' firmware/pio/ststm32/platform.json)
    rm -rf "$platform" "$compiler"
    mkdir -p "$PLATFORMIO_CORE_DIR/platforms" "$compiler"
    cp -R firmware/pio/ststm32 "$platform"
    printf '{"type": "platform", "name": "ststm32", "version": "%s", "spec": {"owner": "platformio", "id": null, "name": "ststm32", "requirements": null, "uri": null}}\n' \
        "$version" >"$platform/.piopm"
    printf '{"name": "toolchain-gccarmnoneeabi", "version": "%s", "description": "The compiler of the system"}\n' \
        "$compiler_package" >"$compiler/package.json"
    printf '{"type": "tool", "name": "toolchain-gccarmnoneeabi", "version": "%s", "spec": {"owner": "platformio", "id": null, "name": "toolchain-gccarmnoneeabi", "requirements": null, "uri": null}}\n' \
        "$compiler_package" >"$compiler/.piopm"
}

if [ ! -f "$scons_folder/.piopm" ] && registry_answers; then
    exit 0
fi
# With a tool-scons that PlatformIO fetched, the registry was there: Unity comes the same way.
if [ -f "$scons_folder/.piopm" ] && [ ! -f "$scons_folder/.bootstrapped" ]; then
    exit 0
fi
if [ ! -f "$scons_folder/.bootstrapped" ]; then
    lay_scons
    touch "$scons_folder/.bootstrapped"
fi
[ -f "$unity_source/.piopm" ] || fetch_unity
lay_ststm32
for environment in $environments; do
    libdeps=$root/.pio/libdeps/$environment
    if [ ! -f "$libdeps/Unity/.piopm" ]; then
        mkdir -p "$libdeps"
        rm -rf "$libdeps/Unity"
        cp -R "$unity_source" "$libdeps/Unity"
    fi
done
