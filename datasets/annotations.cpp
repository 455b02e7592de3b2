#include "duet/datasets/annotations.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/file.h"
#include "duet/core/number.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/results/analyses/text_table.h"

namespace duet {
namespace {

constexpr std::string_view kHeader = "clip,task,reactor,act_begin_s,act_end_s,note";
constexpr std::size_t kFields = 6;

// Fields of one line of CSV (RFC 4180, without line ends inside quotes).
std::vector<std::string> csv_fields(std::string_view line) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (quoted && c == '"' && i + 1 < line.size() && line[i + 1] == '"') {
      fields.back() += line[++i];
    } else if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      fields.emplace_back();
    } else {
      fields.back() += c;
    }
  }
  return fields;
}

// One line of an annotation file, for messages.
struct Line {
  const std::string& file;
  int number = 0;

  [[noreturn]] void refuse(const std::string& problem) const {
    throw InputError(fmt::format("'{}', line {}: {}", file, number, problem));
  }
};

std::optional<double> seconds(const Line& line, std::string_view name, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::optional<double> value = parse_number(text);
  if (!value || *value < 0.0)
    line.refuse(fmt::format("{}: expected seconds from the clip's beginning, found '{}'", name, shown(text)));
  return value;
}

std::optional<Task> task_of(const Line& line, const std::string& text) {
  if (text.empty()) return std::nullopt;
  try {
    return parse_task(text);
  } catch (const std::invalid_argument& error) {
    line.refuse(error.what());
  }
}

std::optional<Person> reactor_of(const Line& line, const std::string& text) {
  if (text.empty()) return std::nullopt;
  if (text != "A" && text != "B") line.refuse(fmt::format("reactor: expected A or B, found '{}'", shown(text)));
  return text == "A" ? Person::kA : Person::kB;
}

Annotation annotation_of(const Line& line, const std::vector<std::string>& fields) {
  if (fields.size() != kFields)
    line.refuse(fmt::format("expected {} fields ({}), found {}", kFields, kHeader, fields.size()));
  Annotation result{.clip = fields[0],
                    .task = task_of(line, fields[1]),
                    .reactor = reactor_of(line, fields[2]),
                    .act_begin = seconds(line, "act_begin_s", fields[3]),
                    .act_end = seconds(line, "act_end_s", fields[4]),
                    .note = fields[5]};
  if (result.clip.empty()) line.refuse("expected the name of a clip, found nothing");
  if (result.act_begin.has_value() != result.act_end.has_value())
    line.refuse("expected both act_begin_s and act_end_s, or neither");
  if (result.act_begin && *result.act_begin >= *result.act_end)
    line.refuse(fmt::format("the act ends at {} s and begins at {} s", *result.act_end, *result.act_begin));
  return result;
}

}  // namespace

Annotations parse_annotations(std::string_view text, const std::string& name) {
  Annotations annotations;
  int number = 0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.ends_with('\r')) line.remove_suffix(1);
    const Line at{.file = name, .number = ++number};
    if (number == 1) {
      if (line != kHeader) at.refuse(fmt::format("expected the header '{}', found '{}'", kHeader, shown(line)));
    } else if (!line.empty()) {
      Annotation annotation = annotation_of(at, csv_fields(line));
      const std::string clip = annotation.clip;
      if (!annotations.emplace(clip, std::move(annotation)).second)
        at.refuse(fmt::format("clip '{}' is there twice", shown(clip)));
    }
  }
  if (number == 0) throw InputError(fmt::format("'{}': expected the header '{}', found nothing", name, kHeader));
  return annotations;
}

Annotations read_annotations(const std::string& path) { return parse_annotations(read_text(path), path); }

std::string annotations_csv(const std::vector<Annotation>& annotations) {
  TextTable table{.header = csv_fields(kHeader), .rows = {}};
  const auto cell = [](const std::optional<double>& value) { return value ? fmt::format("{:.2f}", *value) : ""; };
  for (const Annotation& entry : annotations)
    table.rows.push_back({entry.clip, entry.task ? std::string(to_string(*entry.task)) : "",
                          !entry.reactor                 ? ""
                          : *entry.reactor == Person::kA ? "A"
                                                         : "B",
                          cell(entry.act_begin), cell(entry.act_end), entry.note});
  return csv_table(table);
}

Annotation annotation_of(const InteractionClip& clip) {
  const auto source = clip.source.find("phases");
  return {.clip = clip.id,
          .task = clip.task,
          .reactor = clip.reactor,
          .act_begin = clip.phases.act_begin / clip.rate_hz(),
          .act_end = clip.phases.act_end / clip.rate_hz(),
          .note = source == clip.source.end() ? "" : source->second};
}

void annotate(InteractionClip& clip, const Annotation& annotation) {
  if (annotation.task) clip.task = *annotation.task;
  if (annotation.reactor) clip.reactor = *annotation.reactor;
  if (!annotation.act_begin) return;
  const auto frame = [&](double time) { return static_cast<int>(std::lround(time * clip.rate_hz())); };
  const int begin = frame(*annotation.act_begin), end = std::min(frame(*annotation.act_end), clip.frames());
  if (begin >= end)
    throw InputError(fmt::format("clip '{}': its annotated act [{} s, {} s) is not inside its {:.2f} s", clip.id,
                                 *annotation.act_begin, *annotation.act_end, clip.frames() / clip.rate_hz()));
  clip.phases = {.act_begin = begin, .act_end = end};
  clip.source["phases"] = "annotated";
}

}  // namespace duet
