#!/usr/bin/env bash
# Whether documents and comments cite only files that are there: relative links of Markdown, and paths of Markdown files in
# sources. Prints each citation that leads nowhere; exit 1.
set -euo pipefail
cd "$(dirname "$0")/.."

mapfile -t rooms < <(sed -n 's/^\([a-z]*\):.*/\1/p' cmake/rooms.txt)
folders=("${rooms[@]}" parts tests docs suites profiles examples cmake)
bad=0
missing() { echo "$1: cites '$2', which is not there"; bad=1; }

documents=$(ls ./*.md; find "${folders[@]}" -name '*.md')
while read -r file; do
  while read -r link; do
    [ -e "$(dirname "$file")/$link" ] || missing "$file" "$link"
  done < <(grep -oE '\]\([^)# ]+' "$file" | sed 's/^](//' | grep -vE '^[a-z]+:' || true)
done <<<"$documents"

# Paths as comments write them: from the root of the tree, or a bare ALL-CAPS or reference/ document.
while IFS=: read -r file cited; do
  [ -e "$cited" ] || [ -e "docs/$cited" ] || missing "$file" "$cited"
done < <(grep -roE '\b(docs|reference|design|shared)/[A-Za-z0-9_/-]+\.md|\b[a-z_/0-9]+/README\.md|\b[A-Z]{4,}\.md' "${folders[@]}" run \
  --include='*.h' --include='*.cpp' --include='*.yaml' --include='*.txt' --include='*.cmake' --include='*.md' --include=run |
  grep -vE '/(README|CONTRIBUTING)\.md:|:(README|CONTRIBUTING)\.md$' | sort -u)
[ "$bad" -eq 0 ] && echo "docs: every citation leads somewhere"
exit "$bad"
