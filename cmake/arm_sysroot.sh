#!/usr/bin/env bash
# arm_sysroot.sh FOLDER PACKAGE...: the Debian packages of arm64 that these need, fetched from the places that apt uses here
# and unpacked into FOLDER/root; FOLDER/shlibs says which package each library is of (dpkg-shlibdeps). Nothing of the machine
# changes: apt works on lists and archives of FOLDER alone. FOLDER/complete holds the packages asked for.
set -euo pipefail
folder=$(realpath -m "$1")
shift
rm -rf "$folder"
mkdir -p "$folder"/apt/{lists,archives}/partial "$folder"/root
: >"$folder/apt/status"
options=(-qq -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o APT::Sandbox::User=root -o Dir::State::lists="$folder/apt/lists"
  -o Dir::State::status="$folder/apt/status" -o Dir::State::extended_states="$folder/apt/extended" -o Dir::Cache="$folder/apt" -o Dir::Cache::archives="$folder/apt/archives")
debian=/etc/apt/sources.list.d/debian.sources  # alone, where it is there: other sources may not have this architecture
[ ! -f "$debian" ] || options+=(-o Dir::Etc::sourcelist="$debian" -o Dir::Etc::sourceparts=-)
apt-get "${options[@]}" update
apt-get "${options[@]}" -y --no-install-recommends --download-only install "$@" >/dev/null
for package in "$folder"/apt/archives/*.deb; do
  dpkg-deb --extract "$package" "$folder/root"
  dpkg-deb --info "$package" shlibs 2>/dev/null || true  # a package without libraries has none
done >"$folder/shlibs"
# Links by absolute path lead into the folder, not to this machine.
find "$folder/root" -type l -lname '/*' | while read -r link; do
  target=$folder/root$(readlink "$link")
  [ ! -e "$target" ] || ln -sfn "$target" "$link"
done
rm -rf "$folder/apt"
echo "$*" >"$folder/complete"
