#!/usr/bin/env bash
# The include order of the rooms (docs/architecture.md, "Rooms") and of the units. Prints each include that breaks the
# order of the rooms and each circle of units; exit 1.
# cmake/rooms.txt has that order; a vendor's header stays in its engine, and the folders of a room have no circle either.
# A unit is a header with the .cpp file of its name; a .cpp file without such a header is a unit of its own. No two units
# include each other, directly or through others.
set -euo pipefail
cd "$(dirname "$0")/.."

declare -A may
rooms=()
while IFS=': ' read -r room others; do
  case $room in [a-z]*) rooms+=("$room"); may[$room]="$room $others" ;; esac
done <cmake/rooms.txt
bad=0
for room in "${!may[@]}"; do
  [ -d "$room" ] || continue
  while IFS=: read -r file line text; do
    target=${text#*\"duet/} target=${target%%/*}
    case " ${may[$room]} " in
      *" $target "*) ;;
      *) echo "$file:$line: $room may not include $target ($text)"; bad=1 ;;
    esac
  done < <(grep -rnE '^#include "duet/[a-z]+/' "$room" --include='*.h' --include='*.cpp' || true)
done
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
