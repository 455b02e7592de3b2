#include "duet/datasets/clip_labels.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/split.h"
#include "duet/core/text.h"

namespace duet {
namespace {

constexpr std::string_view kLabelsHeader = "clip,label";

}  // namespace

ClipLabels parse_clip_labels(std::string_view text, const std::string& name) {
  ClipLabels labels;
  int number = 0;
  const auto refuse = [&](const std::string& problem) {
    throw InputError(fmt::format("'{}', line {}: {}", name, number, problem));
  };
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  while (!text.empty()) {
    ++number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (number == 1) {
      if (line != kLabelsHeader)
        refuse(fmt::format("expected the header '{}', found '{}'", kLabelsHeader, shown(line)));
      continue;
    }
    if (line.empty()) continue;
    if (std::count(line.begin(), line.end(), ',') != 1)
      refuse(fmt::format("expected 2 fields ({}), found '{}'", kLabelsHeader, shown(line)));
    const std::size_t comma = line.find(',');
    const std::string clip(trimmed(line.substr(0, comma)));
    if (clip.empty()) refuse("expected a clip's name before the comma, found none");
    if (!labels.emplace(clip, trimmed(line.substr(comma + 1))).second)
      refuse(fmt::format("clip '{}' is there twice", shown(clip)));
  }
  if (number == 0) {
    number = 1;
    refuse(fmt::format("expected the header '{}', found an empty file", kLabelsHeader));
  }
  return labels;
}

ClipLabels read_clip_labels(const std::string& path) { return parse_clip_labels(read_file(path), path); }

}  // namespace duet
