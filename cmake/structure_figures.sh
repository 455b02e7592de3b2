#!/usr/bin/env bash
# Figures of the structure: circles of units, places that step a robot under a controller, what one robot, task, metric,
# perturbation kind and field of a row touch, lines of each room. `structure_figures.sh [COMMIT]` also counts the lines at that commit.
set -euo pipefail
cd "$(dirname "$0")/.."

mapfile -t rooms < <(sed -n 's/^\([a-z]*\):.*/\1/p' cmake/rooms.txt) && rooms+=(parts)
sources() { find "${rooms[@]}" \( -name '*.h' -o -name '*.cpp' \) -print; }
# Product files in which a text stands, by a pattern; the file that others are counted from is left to the reader.
files_with() { sources | xargs grep -lE "$1" | sort; }
indented() { sed 's/^/  /'; }

circles=$(cmake/check_layers.sh | grep -c 'in a circle:$' || true)
echo "circles of units: $circles"

# Where a controller's act() is called: controllers wrap one another, hardware/walker commands over the wire and steps
# no engine, benchmarks time it alone.
loops=$(files_with 'controller_?(->|\.)act\(' | grep -vE '^(controllers/|app/benchmarks/|parts/[a-z]*/[a-z]*_benchmark\.cpp)|^hardware/guard/walker\.cpp$')
echo "places that step a robot under a controller: $(wc -l <<<"$loops")"
indented <<<"$loops"

echo "what names one of each kind (a unit is a header with its .cpp):"
touched() {  # touched WHAT PATTERN
  local units
  units=$(files_with "$2" | sed -E 's/\.(h|cpp)$//' | sort -u)
  echo "  $1: $(wc -w <<<"$units") units"
  indented <<<"$(indented <<<"$units")"
}
echo "  robot 't1': the folder robots/t1, and $(sources | xargs grep -lE '"t1"' | wc -l) source files"
touched "task 'fist_bump' (and a row of tasks/list.cmake)" 'fist_bump'
touched "metric 'jerk'" '"jerk"'
touched "perturbation 'kick' (and a row of rollout/perturbations/perturbation_kinds.cpp)" 'kick_kind|\bKick\b|"kick"'
touched "row field 'policy_ms' (scoring/scoring gives it its value)" '\bpolicy_ms\b'

lines_now() { find "$1" \( -name '*.h' -o -name '*.cpp' \) -exec cat {} + 2>/dev/null | wc -l; }
lines_then() { { git grep -c "" "$1" -- "$2/*.h" "$2/*.cpp" || true; } | awk -F: '{ sum += $NF } END { print sum + 0 }'; }
commit=${1:-}
if [ -n "$commit" ] && ! git cat-file -e "$commit^{commit}" 2>/dev/null; then
  echo "no commit '$commit' in this repository's history" >&2
  exit 2
fi
printf 'lines of product code (.h and .cpp):\n  %-12s %8s %s\n' room now "${commit:+at $commit}"
now_all=0 then_all=0
for room in "${rooms[@]}"; do
  now=$(lines_now "$room") then=
  [ -z "$commit" ] || then=$(lines_then "$commit" "$room")
  printf '  %-12s %8d %s\n' "$room" "$now" "$then"
  now_all=$((now_all + now)) then_all=$((then_all + ${then:-0}))
done
printf '  %-12s %8d %s\n' all "$now_all" "${commit:+$then_all}"
core=0
for room in $(sed -n '/^\[core\]/,/^\[[^c]/s/^\([a-z]*\):.*/\1/p' cmake/rooms.txt); do core=$((core + $(lines_now "$room"))); done
tests=$(lines_now tests) then=
[ -z "$commit" ] || then=$(lines_then "$commit" tests)
printf '  %-12s %8d %s\n' tests "$tests" "$then"
printf '  %-12s %8d (without the parts: rooms that they have, and parts/)\n' core "$core"
