#!/usr/bin/env bash
# Whether code knows a robot: no joint or link of a card may stand in quotes in the product's sources. What a part is for is said by
# the card (roles) and asked by the code. `pelvis` is a joint of a person, too. Prints each place; exit 1.
set -euo pipefail
cd "$(dirname "$0")/.."

folders=$(find . -mindepth 1 -maxdepth 1 -type d ! -name '.*' ! -name build ! -name tests ! -name examples ! -name runs)
cards=$(find robots -mindepth 2 -name '*.yaml')
# shellcheck disable=SC2086
names=$(sed -nE 's/^ *- \{name: ([A-Za-z0-9_]+), +armature.*/\1/p; s/.*[{ ]link: ([A-Za-z0-9_]+).*/\1/p' $cards | sort -u | grep -vx pelvis)
[ "$(wc -l <<<"$names")" -gt 50 ] || { echo "robot names: expected the joints and links of $(wc -w <<<"$cards") cards, found few"; exit 1; }
# shellcheck disable=SC2086
if sed 's/.*/"&"/' <<<"$names" | grep -rnFf - $folders --include='*.h' --include='*.cpp' | grep -vE '^[^:]+:[0-9]+: *//|//.*"'; then
  echo "robot names: the lines above name a joint or a link of a robot; ask its card"
  exit 1
fi
echo "robot names: no source names a joint or a link of a robot"
