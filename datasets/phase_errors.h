// How far the phases that duet proposes lie from those that are known: synthesis knows the act of every clip that it
// makes (supplement B.4 annotated by hand).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "duet/core/task.h"
#include "duet/report/tables/text_table.h"

namespace duet {

struct PhaseError {
  Task task = Task::kHug;
  double begin = 0.0, end = 0.0;  // proposed minus known [s]
  double overlap = 0.0;           // of the two acts: shared over both together
};

// Errors of `count` clips a task, synthesised from `seed`; their own phases are hidden from the proposal.
std::vector<PhaseError> phase_errors(std::span<const Task> tasks, int count, std::uint64_t seed, int threads);

// Per task and in total: clips, median and 90th percentile of the size of both errors [s], median overlap.
TextTable phase_error_table(std::span<const PhaseError> errors);

}  // namespace duet
