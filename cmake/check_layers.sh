#!/usr/bin/env bash
# The include order of the rooms (docs/architecture.md, "Rooms"). Prints each include that breaks it; exit 1.
#   core < motion, robots, nn < retarget, backends, controllers, policies, metrics < bench, training
#   results uses core only; metrics, policies and controllers never include backends; a vendor's header stays in its engine.
set -euo pipefail
cd "$(dirname "$0")/.."

declare -A may=(
  [core]="core"
  [motion]="core motion"
  [robots]="core robots"
  [nn]="core nn"
  [retarget]="core motion robots retarget"
  [backends]="core robots backends"
  [controllers]="core robots nn controllers"
  [policies]="core robots nn policies"
  [metrics]="core motion robots metrics"
  [training]="core motion robots nn backends controllers policies metrics training"
  [results]="core results"
)
bad=0
for room in "${!may[@]}"; do
  [ -d "$room" ] || continue
  while IFS=: read -r file line text; do
    target=$(sed -E 's/.*"([a-z]+)\/.*/\1/' <<<"$text")
    case " ${may[$room]} " in
      *" $target "*) ;;
      *) echo "$file:$line: $room may not include $target ($text)"; bad=1 ;;
    esac
  done < <(grep -rnE '^#include "[a-z]+/' "$room" --include='*.h' --include='*.cpp' || true)
done
vendor() {  # vendor FOLDER PATTERN: headers that match PATTERN appear only in FOLDER
  local hits
  hits=$(grep -rnE "^#include [<\"]($2)" core motion robots nn retarget backends controllers policies metrics results training bench \
    --include='*.h' --include='*.cpp' 2>/dev/null | grep -vE "^$1/" || true)
  if [ -n "$hits" ]; then echo "$hits"; echo "only $1/ may include $2"; bad=1; fi
}
vendor backends/mujoco 'mujoco/'
vendor backends/bullet 'bt[A-Z]|Bullet'
vendor backends/ode 'ode/'
vendor backends/simbody 'Simbody|SimTK|simbody'
vendor backends/dart 'dart/'
vendor results 'sqlite3\.h'
vendor robots 'urdf_'
vendor nn 'onnx/|google/protobuf'
[ "$bad" -eq 0 ] && echo "layers: every include respects the order of the rooms"
exit "$bad"
