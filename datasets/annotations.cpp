#include "duet/datasets/annotations.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/archives/csv.h"
#include "duet/core/data_file.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/report/tables/text_table.h"

namespace duet {
namespace {

const std::vector<std::string> kHeader = {"clip", "task", "reactor", "act_begin_s", "act_end_s", "note"};

std::optional<double> seconds(const CsvReader& line, std::string_view name, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::optional<double> value = line.number(text);
  if (!value || *value < 0.0)
    line.fail(fmt::format("{}: expected seconds from the clip's beginning, found '{}'", name, shown(text)));
  return value;
}

std::optional<Task> task_of(const CsvReader& line, const std::string& text) {
  if (text.empty()) return std::nullopt;
  try {
    return parse_task(text);
  } catch (const std::invalid_argument& error) {
    line.fail(error.what());
  }
}

std::optional<Person> reactor_of(const CsvReader& line, const std::string& text) {
  if (text.empty()) return std::nullopt;
  if (text != "A" && text != "B") line.fail(fmt::format("reactor: expected A or B, found '{}'", shown(text)));
  return text == "A" ? Person::kA : Person::kB;
}

// The annotation in the row that the reader stands on.
Annotation annotation_in(const CsvReader& line) {
  const auto fields = line.fields();
  if (fields.size() != kHeader.size())
    line.fail(fmt::format("expected {} fields ({}), found {}", kHeader.size(), fmt::join(kHeader, ","), fields.size()));
  Annotation result{.clip = fields[0],
                    .task = task_of(line, fields[1]),
                    .reactor = reactor_of(line, fields[2]),
                    .act_begin = seconds(line, "act_begin_s", fields[3]),
                    .act_end = seconds(line, "act_end_s", fields[4]),
                    .note = fields[5]};
  if (result.clip.empty()) line.fail("expected the name of a clip, found nothing");
  if (result.act_begin.has_value() != result.act_end.has_value())
    line.fail("expected both act_begin_s and act_end_s, or neither");
  if (result.act_begin && *result.act_begin >= *result.act_end)
    line.fail(fmt::format("the act ends at {} s and begins at {} s", *result.act_end, *result.act_begin));
  return result;
}

}  // namespace

Annotations parse_annotations(std::string_view text, const std::string& name) {
  Annotations annotations;
  CsvReader rows(text, name);
  require_header(rows, kHeader);
  while (rows.next()) {
    if (rows.blank()) continue;
    Annotation annotation = annotation_in(rows);
    const std::string clip = annotation.clip;
    if (!annotations.emplace(clip, std::move(annotation)).second)
      rows.fail(fmt::format("clip '{}' is there twice", shown(clip)));
  }
  return annotations;
}

Annotations read_annotations(const std::string& path) { return parse_annotations(read_plain_text(path), path); }

std::string annotations_csv(const std::vector<Annotation>& annotations) {
  TextTable table{.header = kHeader, .rows = {}};
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
