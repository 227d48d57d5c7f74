#!/usr/bin/env bash
# The system packages that `make test` needs. As root it installs what is missing; otherwise it names the
# one command that does. Packages are looked for by the programs they bring, so other systems work as well.
set -euo pipefail

declare -A program_of=(
  [gcc]=gcc
  [gcc-arm-none-eabi]=arm-none-eabi-gcc
  [qemu-system-arm]=qemu-system-arm
  [cppcheck]=cppcheck
  [clang-format]=clang-format
  [clang-tidy]=clang-tidy
  [clang]=clang
  [cargo]=cargo
  [chromium]=chromium
)

missing=()
for package in "${!program_of[@]}"; do
  command -v "${program_of[$package]}" >/dev/null || missing+=("$package")
done
# newlib has no program of its own: the cross compiler knows where its library is.
if ! { command -v arm-none-eabi-gcc && [ "$(arm-none-eabi-gcc -print-file-name=libc.a)" != libc.a ]; } >/dev/null; then
  missing+=(libnewlib-arm-none-eabi)
fi

# Neither has the runtime of clang's fuzzer and sanitizers, which Debian packages by clang's version.
runtime=libclang-rt-dev
if command -v clang >/dev/null; then
  version=$(clang -dumpversion | cut -d. -f1)
  runtime=libclang-rt-$version-dev
  ! compgen -G "$(clang -print-resource-dir)/lib/*/libclang_rt.fuzzer*" >/dev/null || runtime=
fi
[ -z "$runtime" ] || missing+=("$runtime")

[ "${#missing[@]}" -eq 0 ] && exit 0

install="apt-get install --yes --no-install-recommends ${missing[*]}"
if ! command -v apt-get >/dev/null; then
  echo "make test needs these tools, by their Debian names: ${missing[*]}" >&2
  exit 1
fi
if [ "$(id -u)" -ne 0 ]; then
  echo "make test needs more system packages. Run once: sudo $install" >&2
  exit 1
fi
echo "installing: ${missing[*]}"
apt-get update -qq
DEBIAN_FRONTEND=noninteractive $install >/dev/null
