#include "duet/datasets/labelled/clip_labels.h"

#include <fmt/format.h>

#include <vector>

#include "duet/archives/csv.h"
#include "duet/core/data_file.h"
#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

const std::vector<std::string> kLabelsHeader = {"clip", "label"};

}  // namespace

ClipLabels parse_clip_labels(std::string_view text, const std::string& name) {
  ClipLabels labels;
  CsvReader rows(text, name);
  require_header(rows, kLabelsHeader);
  while (rows.next()) {
    if (rows.blank()) continue;
    const auto fields = rows.fields();
    if (fields.size() != kLabelsHeader.size())
      rows.fail(
          fmt::format("expected 2 fields (clip,label), found '{}'", shown(fmt::format("{}", fmt::join(fields, ",")))));
    if (fields[0].empty()) rows.fail("expected a clip's name in the first field, found none");
    if (!labels.emplace(fields[0], fields[1]).second)
      rows.fail(fmt::format("clip '{}' is there twice", shown(fields[0])));
  }
  return labels;
}

ClipLabels read_clip_labels(const std::string& path) { return parse_clip_labels(read_plain_text(path), path); }

}  // namespace duet
