#!/usr/bin/env bash
# package.sh BUILD OUT: Debian packages of what BUILD has built: duet (the program, its engines and shipped files) and
# libduet-dev (headers, static libraries, packages for CMake and pkg-config). Libraries that the program needs are
# Depends, those that only an engine needs Recommends: without them that engine is absent, and `duet doctor` says why.
# Where DUET_SYSROOT names libraries of 64-bit ARM (cmake/arm_sysroot.sh), BUILD was made by cmake/aarch64.cmake: duet alone.
# package.sh --source OUT: a tarball of the commit with all that a build needs beside Debian's packages.
set -euo pipefail
cd "$(dirname "$0")/.."
version=$(sed -nE 's/^project\(duet VERSION ([0-9.]+).*/\1/p' CMakeLists.txt)

source_tarball() {
  mkdir -p "$1"
  git archive --format=tar --prefix="duet-$version/" HEAD | gzip -9n >"$1/duet-$version.tar.gz"
  echo "$1/duet-$version.tar.gz"
}

# What the program and its engines link with: the lines Depends and Recommends, the latter without what is in the former.
needs() {
  local bin=(usr/bin/*) engines=(usr/lib/duet/engines/*.so)
  dpkg-shlibdeps "${libraries[@]}" --ignore-missing-info -O -dDepends "${bin[@]/#/-e}" -dRecommends "${engines[@]/#/-e}" 2>/dev/null | sed -nE 's/^shlibs:(Depends|Recommends)=/\1: /p'
}

licences() {
  cat <<'TEXT'
Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: duet
Comment: The program contains code of header-only libraries: Eigen (MPL-2.0), CLI11 (BSD-3-Clause), nlohmann_json (MIT),
 fmt (MIT). Their licences are in their Debian packages. Networks and robot descriptions that ship were made by this project.

Files: *
Copyright: the authors of duet
License: Apache-2.0
 On Debian systems the text stands in /usr/share/common-licenses/Apache-2.0.
TEXT
}

control() {  # control PACKAGE FOLDER DESCRIPTION LONG FIELDS
  local size
  size=$(du -sk "$2" | cut -f 1)
  printf '%s\n' "Package: $1" "Version: $version" "Architecture: $architecture" "Section: science" "Priority: optional" \
    "Maintainer: ${DUET_MAINTAINER:-The authors of duet <duet@localhost>}" "Installed-Size: $size" "$5" "Description: $3" " $4"
}

pack() {  # pack PACKAGE: $out/PACKAGE with its DEBIAN/control, to a file
  local folder=$out/$1 file
  install -Dm 644 <(licences) "$folder/usr/share/doc/$1/copyright"
  gzip -9nc CHANGELOG.md >"$folder/usr/share/doc/$1/changelog.gz"
  chmod -R u+w,go-w "$folder"
  file=$out/${1}_${version}_$architecture.deb
  dpkg-deb --root-owner-group -Zxz -z3 --build "$folder" "$file" >/dev/null
  echo "$file"
}

program_package() {
  local root=$out/duet usr=$out/duet/usr
  cmake --install "$build" --prefix "$usr" --component share >/dev/null
  cmake --install "$build" --prefix "$usr" --component program --strip >/dev/null
  [ -f "$usr/share/man/man1/duet.1" ] || install -Dm 644 <("${emulator[@]}" "$build/duet" man) "$usr/share/man/man1/duet.1"
  find "$usr/share/man" -name '*.1' -exec gzip -9n {} +
  rm -f "$usr/share/doc/duet/LICENSE"  # the same as the copyright of the package
  install -Dm 644 README.md "$usr/share/doc/duet/README.md"
  install -Dm 644 policies/dstar/README.md "$usr/share/doc/duet/dstar.md"
  install -Dm 644 controllers/wbc_sim/README.md "$usr/share/doc/duet/wbc_sim.md"
  mkdir -p "$root/DEBIAN"
  mkdir -p "$root/debian"
  printf 'Source: duet\n\nPackage: duet\nArchitecture: any\n' >"$root/debian/control"
  (cd "$root" && needs) >"$out/needs"
  rm -r "$root/debian"
  control duet "$root" "benchmark of two-person interactions with a humanoid" \
    "Retargets the motion of two people to a humanoid, rolls policies out through whole-body controllers in physics engines, and ranks them." \
    "$(cat "$out/needs")" >"$root/DEBIAN/control"
  pack duet
}

library_package() {
  local root=$out/libduet-dev
  cmake --install "$build" --prefix "$root/usr" --component library >/dev/null
  cmake --install "$build" --prefix "$root/usr" --component parts >/dev/null
  mkdir -p "$root/DEBIAN"
  local packages="Depends: duet (= $version), libeigen3-dev, libfmt-dev, libtbb-dev, libssl-dev, nlohmann-json3-dev, libyaml-cpp-dev, libprotobuf-dev, libonnx-dev"
  packages+=", libsqlite3-dev, zlib1g-dev, libzstd-dev, libzip-dev, liburdfdom-dev, libconsole-bridge-dev, libtinyxml-dev, pkg-config"
  control libduet-dev "$root" "libraries of duet for C++ programs" \
    "Headers, static libraries, and what find_package(duet) and pkg-config read." "$packages"$'\n'"Suggests: cmake, g++" >"$root/DEBIAN/control"
  pack libduet-dev
}

if [ "${1:-}" = --source ]; then
  source_tarball "$2"
  exit
fi
build=$(realpath "$1")
out=$(realpath -m "$2")
emulator=() libraries=()
if [ -n "${DUET_SYSROOT:-}" ]; then
  export DEB_HOST_ARCH=arm64
  emulator=(qemu-aarch64-static -L "$DUET_SYSROOT")
  libraries=(-l"$DUET_SYSROOT"/{usr/,}lib/aarch64-linux-gnu -L"$DUET_SYSROOT/../shlibs")
fi
architecture=$(dpkg-architecture -q DEB_HOST_ARCH 2>/dev/null)
rm -rf "${out:?}"/{duet,libduet-dev} "$out"/*.deb
mkdir -p "$out"
program_package
[ -n "${DUET_SYSROOT:-}" ] || library_package
