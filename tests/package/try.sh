#!/usr/bin/env bash
# try.sh FOLDER PACKAGES: installs the .deb files of the folder PACKAGES on a bare Debian 12, made below FOLDER by debootstrap, and uses
# them there as somebody would who has no source tree: doctor, a small demo, a program that links duet. Ends at the first
# thing that is not as it should be. Needs root and the network; what it made of Debian is kept for the next time.
set -euo pipefail
folder=$(realpath -m "$1")
packages=$(realpath "$2")
examples=$(realpath "$(dirname "$0")/../../examples/cpp")
base=$folder/bookworm root=$folder/trial
export DEBIAN_FRONTEND=noninteractive LC_ALL=C

[ "$(id -u)" -eq 0 ] || { echo "package trial: not run: root is needed for debootstrap and chroot" >&2; exit 4; }
command -v debootstrap >/dev/null || { echo "package trial: not run: debootstrap is not installed" >&2; exit 4; }
# The trial has mounts of its own, which end with it.
[ -n "${DUET_TRIAL_MOUNTS:-}" ] || DUET_TRIAL_MOUNTS=1 exec unshare --mount bash "$0" "$@"

fail() { echo "package trial: $1" >&2; exit 1; }
inside() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/srv LC_ALL=C DEBIAN_FRONTEND=noninteractive bash -euc "$1"; }
expect() {  # expect NAME PATTERN TEXT
  grep -qE -- "$2" <<<"$3" || fail "$1: expected /$2/, found: $3"
}

if [ ! -f "$base/etc/debian_version" ] || [ ! -f "$folder/bookworm.complete" ]; then
  rm -rf "$base"
  mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Codename: bookworm' | head -n 1)
  debootstrap --variant=minbase bookworm "$base" ${mirror:+"$mirror"} >"$folder/debootstrap.log"
  touch "$folder/bookworm.complete"
fi
rm -rf "$root"
cp -a --reflink=auto "$base" "$root"
cp /etc/resolv.conf "$root/etc/resolv.conf"
mount -t proc proc "$root/proc"
mkdir -p "$root/packages"
cp "$packages"/*.deb "$root/packages/"

inside 'apt-get update -qq; apt-get install -y -qq -o Dpkg::Use-Pty=0 --no-install-recommends /packages/duet_*.deb >/dev/null'
inside 'command -v gcc cc c++' >/dev/null 2>&1 && fail "a compiler came with duet"
doctor=$(inside 'duet doctor')
expect "doctor without engines" 'absent engine mujoco' "$doctor"
expect "doctor without engines" 'ok +controller wbc_sim' "$doctor"
if inside 'duet doctor --need mujoco' >/dev/null 2>&1; then fail "doctor --need mujoco passes without MuJoCo"; fi

inside "apt-get install -y -qq -o Dpkg::Use-Pty=0 --no-install-recommends \$(dpkg-query -W -f '\${Recommends}' duet | sed 's/([^)]*)//g; s/,/ /g') >/dev/null"
inside 'duet doctor --need mujoco,bullet,ode,simbody,dart' >/dev/null || fail "an engine is absent with all that is recommended"
inside 'duet --version; test -s /usr/share/man/man1/duet.1.gz; test -s /usr/share/doc/duet/copyright'

inside 'mkdir /srv/demo; cd /srv/demo
  duet synth hug -n 1 -o clips -q
  duet retarget clips -o paired -q
  duet score paired -q
  duet run demo --clips paired --controllers wbc_sim,vmc -s record.trajectories=all -o run -q
  duet report run --format html,md,csv -o report -q >/dev/null
  duet replay run -o replay.html -q
  test -s report/report.html; test -s replay.html'
rows=$(inside 'cat /srv/demo/run/episodes.jsonl')
for engine in mujoco bullet ode simbody dart; do expect "rows of the demo" "\"engine\": ?\"$engine\"" "$rows"; done
if grep -q '"outcome": *"error"' <<<"$rows"; then fail "an episode of the demo ended with an error"; fi

inside 'apt-get install -y -qq -o Dpkg::Use-Pty=0 --no-install-recommends /packages/libduet-dev_*.deb cmake g++ make >/dev/null'
cp -r "$examples/score_my_motion" "$root/srv/score_my_motion"
inside 'cd /srv/score_my_motion; cmake -S . -B build -D CMAKE_BUILD_TYPE=Debug >/dev/null; cmake --build build >/dev/null'
scores=$(inside 'build=/srv/score_my_motion/build; $build/score_my_motion /srv/demo/paired/*.npz')
expect "a program that links duet" 'hug (not )?detected' "$scores"
echo "package trial: installed, $(grep -c . <<<"$rows") episodes in five engines, a program linked by find_package(duet)"
