#!/usr/bin/env bash
# try_arm.sh PACKAGES BUILD: unpacks the package for 64-bit ARM, uses it under qemu-user with the libraries of $DUET_SYSROOT,
# and runs those tests of the room `hardware` in BUILD that need no real time. Ends at the first thing that is not as it should be.
set -euo pipefail
cd "$(dirname "$0")/../.."
packages=$(realpath "$1")
build=$(realpath "$2")
trial=$packages/trial
fail() { echo "package trial: $1" >&2; exit 1; }
emulated() { nice -n 15 qemu-aarch64-static -L "$DUET_SYSROOT" "$@"; }
expect() {  # expect NAME CODE PATTERN ARGUMENT...: what the program says and how it ends
  local code=0 text
  text=$(cd "$trial" && emulated "$trial/usr/bin/duet" "${@:4}" 2>&1) || code=$?
  [ "$code" = "$2" ] || fail "$1: expected exit code $2, found $code: $text"
  grep -qE -- "$3" <<<"$text" || fail "$1: expected /$3/, found: $text"
}

package=("$packages"/duet_*_arm64.deb)
rm -rf "$trial"
dpkg-deb --extract "${package[0]}" "$trial"
dpkg-deb --field "${package[0]}" Architecture Depends Recommends
readelf -h "$trial/usr/bin/duet" | grep -q AArch64 || fail "the program is not for 64-bit ARM"
expect version 0 'mujoco [0-9]' --version
expect doctor 0 'ok +controller wbc_sim' doctor --need mujoco
# Reading its network, D-STAR plans what the file says that it planned on x86-64, within kPlanGoldenError.
expect "a policy" 0 'came back: 100 references' policy check dstar
expect "a key" 0 'made .guard.key' hw key guard.key
cp examples/hardware/twin.yaml "$trial"
expect "nobody there" 4 'no state of twin .* has come' hw check twin.yaml --seconds 1
# What each frame, datagram and command passes; neither real time nor whole walks, each of which takes minutes here.
suites=(GuardMessage DatagramSocket LcmMessage Limiter HardwareLimits FrameChecksum LowCommandFrame LowStateFrame
  RobotGuard StreamOrder RunOrDamp SafetyMachine SealedDatagram SealGate NetworkKey NetworkCounts NetworkAddress
  Checklist)
emulated "$build/tests/hardware/hardware_test" --gtest_brief=1 --gtest_filter="$(printf '%s.*:' "${suites[@]}")"
