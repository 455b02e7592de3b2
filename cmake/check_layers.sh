#!/usr/bin/env bash
# The include order of the rooms (docs/architecture.md, "Rooms") and of the units. Prints each include that breaks the
# order of the rooms and each circle of units; exit 1.
# cmake/rooms.txt has that order; a vendor's header stays in its engine, and the folders of a room have no circle either.
# A unit is a header with the .cpp file of its name; a .cpp file without such a header is a unit of its own. No two units
# include each other, directly or through others.
set -euo pipefail
cd "$(dirname "$0")/.."

declare -A may part_of needs
rooms=()
while read -r line; do
  case $line in
    '['*) read -ra words <<<"${line//[][]/}"; part=${words[0]} needs[$part]=" core ${words[*]:2} $part " ;;
    [a-z]*:*) room=${line%%:*} rooms+=("${line%%:*}"); may[$room]=" $room ${line#*:} " part_of[$room]=$part ;;
  esac
done <cmake/rooms.txt
bad=0
for room in "${rooms[@]}"; do
  for other in ${may[$room]}; do
    [[ ${needs[${part_of[$room]}]} == *" ${part_of[$other]:-none} "* ]] ||
      { echo "cmake/rooms.txt: $room (${part_of[$room]}) may not include $other (${part_of[$other]:-no room})"; bad=1; }
  done
done
check_includes() {  # check_includes FOLDER WORDS: its files include of duet what lies in these folders
  local file line text target
  while IFS=: read -r file line text; do
    target=${text#*\"duet/}
    [[ $target == parts/* ]] && target=${target#parts/} target=parts/${target%%/*} || target=${target%%/*}
    [[ $2 == *" $target "* ]] || { echo "$file:$line: $1 may not include $target ($text)"; bad=1; }
  done < <(grep -rnE '^#include "duet/[a-z]+/' "$1" --include='*.h' --include='*.cpp' || true)
}
for room in "${rooms[@]}"; do check_includes "$room" "${may[$room]}"; done
for part in "${!needs[@]}"; do  # what adds a part to the program
  words=" parts/$part "
  for room in "${rooms[@]}"; do [[ ${needs[$part]} != *" ${part_of[$room]} "* ]] || words+="$room "; done
  [ "$part" = core ] || check_includes "parts/$part" "$words"
done
# Tests of the core's rooms are built without the parts, but for those of the program and of all readers (tests/fuzz).
words= room_tests=()
for room in "${rooms[@]}"; do
  [[ ${part_of[$room]} != core ]] || { words+=" $room "; [ "$room" = app ] || [ ! -d "tests/$room" ] || room_tests+=("tests/$room"); }
done
for folder in "${room_tests[@]}"; do check_includes "$folder" "$words"; done
rooms+=(parts)
vendor() {  # vendor FOLDER PATTERN: headers that match PATTERN appear only in FOLDER
  local hits
  hits=$(grep -rnE "^#include [<\"]($2)" "${rooms[@]}" --include='*.h' --include='*.cpp' 2>/dev/null | grep -vE "^$1/" || true)
  if [ -n "$hits" ]; then echo "$hits"; echo "only $1/ may include $2"; bad=1; fi
}
vendor backends/mujoco 'mujoco/'
vendor backends/bullet 'bt[A-Z]|Bullet'
vendor backends/ode 'ode/'
vendor backends/simbody 'Simbody|SimTK|simbody'
vendor backends/dart 'dart/'
vendor rows 'sqlite3\.h'
vendor robots 'urdf_'
vendor nn 'onnx/|google/protobuf'
vendor hardware/dds 'dds/'

# "UNIT INCLUDED-UNIT" for each include between two units.
unit_includes() {
  { find "${rooms[@]}" -name '*.h'; grep -rE '^#include "duet/' "${rooms[@]}" --include='*.h' --include='*.cpp'; } | awk -F: '
    NF == 1 { sub(/\.h$/, ""); has_header[$0]; next }
    {
      unit = $1
      sub(/\.(h|cpp)$/, "", unit)
      if ($1 ~ /\.cpp$/ && !(unit in has_header)) unit = $1
      split($2, quoted, "\"")
      included = quoted[2]
      sub(/^duet\//, "", included)
      sub(/\.h$/, "", included)
      if (included != unit) print unit, included
    }'
}
# "FOLDER INCLUDED-FOLDER" for each include between two folders that hold files.
folder_includes() {
  grep -rE '^#include "duet/' "${rooms[@]}" --include='*.h' --include='*.cpp' | awk -F: '
    {
      split($2, quoted, "\"")
      from = $1; to = quoted[2]
      sub(/^duet\//, "", to); sub(/\/[^\/]*$/, "", from); sub(/\/[^\/]*$/, "", to)
      if (from != to) print from, to
    }' | sort -u
}
circles=$(folder_includes | tsort 2>&1 >/dev/null | sed -E 's/^tsort: //; s/^-: input contains a loop:$/folders that include each other in a circle:/; /circle:$/!s/^/  /' || true)
if [ -n "$circles" ]; then echo "$circles"; bad=1; fi
circles=$(unit_includes | tsort 2>&1 >/dev/null | sed -E 's/^tsort: //; s/^-: input contains a loop:$/units that include each other in a circle:/; /circle:$/!s/^/  /' || true)
if [ -n "$circles" ]; then echo "$circles"; bad=1; fi
[ "$bad" -eq 0 ] && echo "layers: every include respects the order of the rooms, and neither folders nor units include each other in a circle"
exit "$bad"
