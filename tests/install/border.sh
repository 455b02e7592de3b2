#!/usr/bin/env bash
# border.sh BUILD SCRATCH PART: proves the border between the core and its parts. The core of BUILD, installed alone, is all
# that PART needs to be built and to pass its tests; a program without a part says which one a command belongs to; and
# `./run layers` refuses a room of the core that includes a part's. Exit 1 at the first thing that is otherwise.
set -euo pipefail
cd "$(dirname "$0")/../.."
build=$1 scratch=$2 part=$3
prefix=$PWD/$scratch/prefix
fail() { echo "border: $*" >&2; exit 1; }

rm -rf "$scratch/prefix" "$scratch/tree"
mkdir -p "$scratch/tree"
for component in library share program; do cmake --install "$build" --prefix "$prefix" --component "$component" >/dev/null; done
mapfile -t rooms < <(sed -n '/^\[core\]/d; /^\[/,$s/^\([a-z]*\):.*/\1/p' cmake/rooms.txt)
for room in "${rooms[@]}"; do
  [ ! -e "$prefix/include/duet/$room" ] || fail "$room/ is a part's, and was installed with the core"
done
# What any part and its tests include of the core is installed, whichever part is built below.
while IFS=: read -r file line; do
  header=${line#*\"duet/} header=${header%%\"*}
  [[ " ${rooms[*]} parts " == *" ${header%%/*} "* || -e $prefix/include/duet/$header ]] || fail "$file includes duet/$header, which is not installed"
done < <(grep -rE '^#include "duet/' parts "${rooms[@]}" "${rooms[@]/#/tests/}" --include='*.h' --include='*.cpp')

cmake -S parts -B "$scratch/$part" -G Ninja -DCMAKE_BUILD_TYPE=Release -DDUET_PARTS="$part" -DCMAKE_PREFIX_PATH="$prefix" >/dev/null
cmake --build "$scratch/$part" -j "${DUET_JOBS:-$(nproc)}"
ctest --test-dir "$scratch/$part" --output-on-failure -j "${DUET_JOBS:-$(nproc)}"

declare -A command=([data]=import [training]=train [robot]=hw [cluster]=plan)
for other in "${!command[@]}"; do
  code=0
  said=$("$scratch/$part/duet" "${command[$other]}" --help 2>&1) || code=$?
  case $code in
    0) [ "$other" = "$part" ] || grep -q "^\[$part needs .*\b$other\b" cmake/rooms.txt || fail "the part $part has brought 'duet ${command[$other]}'" ;;
    4) [[ $other != "$part" && $said == *"belongs to the part '$other'"* ]] || fail "'duet ${command[$other]}': $said" ;;
    *) fail "'duet ${command[$other]} --help' ended with $code: $said" ;;
  esac
done

git ls-files -z | grep -zE '\.(h|cpp)$|^cmake/' | tar -c --null -T - | tar -x -C "$scratch/tree"
refused() {  # refused FILE LINE WORDS: with this line in the file the check says these words
  local kept said
  kept=$(cat "$scratch/tree/$1")
  printf '%s\n' "$2" >>"$scratch/tree/$1"
  ! said=$("$scratch/tree/cmake/check_layers.sh") || fail "./run layers takes '$2' in $1"
  [[ $said == *"$3"* ]] || fail "./run layers: expected '$3', found: $said"
  printf '%s\n' "$kept" >"$scratch/tree/$1"
}
"$scratch/tree/cmake/check_layers.sh" >/dev/null || fail "./run layers refuses the tree as it is"
refused scoring/scoring.h '#include "duet/hardware/safety/limits.h"' 'scoring may not include hardware'
refused parts/data/convert.h '#include "duet/hardware/safety/limits.h"' 'parts/data may not include hardware'
refused app/program.cpp '#include "duet/parts/robot/part.h"' 'app may not include parts/robot'
refused cmake/rooms.txt 'statistics: core hardware' 'statistics (cluster) may not include hardware (robot)'
echo "border: the part $part is built and passes its tests against the installed core"
