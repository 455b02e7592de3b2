#!/usr/bin/env bash
# One definition for each name: no two headers define a type of the same name in the same namespace, which a linker would
# not notice. Prints each name with the places that define it; exit 1. And one door out for JSON: nlohmann's dump()
# throws for bytes that are no UTF-8, when the work is done; dumped() of core/json.h does not.
set -euo pipefail
cd "$(dirname "$0")/.."

mapfile -t rooms < <(sed -n 's/^\([a-z]*\):.*/\1/p' cmake/rooms.txt) && rooms+=(parts)
[ $# -eq 0 ] || rooms=("$@")

# "NAMESPACE::NAME FILE:LINE" for each type that a header defines at the level of a namespace: clang-format leaves these
# at the start of a line. Declarations ahead end with ';', specialisations have '<' after the name.
definitions() {
  find "${rooms[@]}" -name '*.h' | sort | while read -r file; do
    awk -v file="$file" '
      /^namespace [A-Za-z_:]+ \{$/ { space[++depth] = $2; next }
      /^namespace \{$/ { space[++depth] = file; next }
      /^\}  \/\/ namespace/ { depth--; next }
      /^(struct|class|enum class|enum) [A-Za-z_]/ {
        line = $0
        if (line ~ /^[^{]*;/) next
        sub(/^(struct|class|enum class|enum) /, "", line)
        match(line, /^[A-Za-z_0-9]+/)
        name = substr(line, 1, RLENGTH)
        if (substr(line, RLENGTH + 1, 1) == "<") next
        full = name
        for (i = depth; i > 0; i--) full = space[i] "::" full
        print full, file ":" FNR
      }' "$file"
  done
}
bare=$(grep -rnE '(\.|->)dump\(' --include='*.cpp' --include='*.h' "${rooms[@]}" python |
  grep -vE '^core/json\.cpp:|joblib\.dump' || true)
if [ -n "$bare" ]; then
  echo "$bare"
  echo "expected dumped() of core/json.h, found dump(), which throws for text that is no UTF-8"
  exit 1
fi
twice=$(definitions | sort | awk '
  { if ($1 in places) { many[$1] = 1; places[$1] = places[$1] ", " $2 } else places[$1] = $2 }
  END { for (name in many) print name ": defined in " places[name] }' | sort)
if [ -n "$twice" ]; then
  echo "$twice"
  exit 1
fi
echo "types: no two headers define a type of the same name"
