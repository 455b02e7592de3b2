#include "duet/datasets/annotations.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/archives/csv.h"
#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/motion/interaction_clip.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/report/tables/text_table.h"

namespace duet {
namespace {

const std::vector<std::string> kHeader = {"clip", "task", "reactor", "act_begin_s", "act_end_s", "note"};

std::optional<double> seconds(const CsvReader& line, std::string_view name, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::optional<double> value = line.number(text);
  if (!value || *value < 0.0)
    line.fail(fmt::format("{}: expected seconds from the clip's beginning, found '{}'", name, excerpt(text)));
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
  if (text != "A" && text != "B") line.fail(fmt::format("reactor: expected A or B, found '{}'", excerpt(text)));
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
      rows.fail(fmt::format("clip '{}' is there twice", excerpt(clip)));
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

namespace {

PhaseError error_of(const InteractionClip& clip) {
  const Phases known = clip.phases, proposed = propose_phases(clip.a, clip.b, clip.task);
  const int shared =
      std::max(0, std::min(known.act_end, proposed.act_end) - std::max(known.act_begin, proposed.act_begin));
  const int both = known.act_end - known.act_begin + proposed.act_end - proposed.act_begin - shared;
  return {.task = clip.task,
          .begin = (proposed.act_begin - known.act_begin) / clip.rate_hz(),
          .end = (proposed.act_end - known.act_end) / clip.rate_hz(),
          .overlap = static_cast<double>(shared) / both};
}

std::vector<std::string> row_of(const std::string& name, const std::vector<PhaseError>& errors) {
  std::vector<double> begin, end, overlap;
  for (const PhaseError& error : errors) {
    begin.push_back(std::abs(error.begin));
    end.push_back(std::abs(error.end));
    overlap.push_back(error.overlap);
  }
  const auto cell = [](const std::vector<double>& values, double p) {
    return fmt::format("{:.2f}", quantile(values, p));
  };
  return {name,
          std::to_string(errors.size()),
          cell(begin, 0.5),
          cell(begin, 0.9),
          cell(end, 0.5),
          cell(end, 0.9),
          cell(overlap, 0.5)};
}

}  // namespace

std::vector<PhaseError> phase_errors(std::span<const Task> tasks, int count, std::uint64_t seed, int threads) {
  std::vector<PhaseError> errors(tasks.size() * static_cast<std::size_t>(count));
  parallel_for_each(static_cast<int>(errors.size()), threads, [&](int i) {
    SynthesisOptions options;
    options.seed = seed;
    options.index = i % count;
    errors[static_cast<std::size_t>(i)] = error_of(synthesize(tasks[static_cast<std::size_t>(i / count)], options));
  });
  return errors;
}

TextTable phase_error_table(std::span<const PhaseError> errors) {
  TextTable table{
      .header = {"task", "clips", "begin, median s", "begin, p90 s", "end, median s", "end, p90 s", "overlap, median"},
      .rows = {}};
  for (const Task task : all_tasks()) {
    std::vector<PhaseError> own;
    std::ranges::copy_if(errors, std::back_inserter(own), [&](const PhaseError& error) { return error.task == task; });
    if (!own.empty()) table.rows.push_back(row_of(std::string(to_string(task)), own));
  }
  if (table.rows.size() > 1) table.rows.push_back(row_of("all", {errors.begin(), errors.end()}));
  return table;
}

}  // namespace duet
