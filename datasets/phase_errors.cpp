#include "duet/datasets/phase_errors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/order_statistics.h"
#include "duet/core/parallel.h"
#include "duet/motion/phase_proposal.h"
#include "duet/motion/synthesis/synthesis.h"

namespace duet {
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
