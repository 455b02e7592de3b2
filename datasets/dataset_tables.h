// The tables of a data set, made of its entries alone.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "duet/datasets/entry.h"
#include "duet/report/tables/text_table.h"

namespace duet {

// Table S5: the statistics of all clips that could be read, of those that the gates kept, and the change.
TextTable curation_table(std::span<const DatasetEntry> entries);
// Table S6: samples, frames, seconds, and their means, per task and in total, of the clips kept.
TextTable task_table(std::span<const DatasetEntry> entries);
// How many clips are kept, rejected (and by which gate), of other tasks, failed.
TextTable outcome_table(std::span<const DatasetEntry> entries);
// Each clip that is not kept, with its reasons and its picture ("" where there is none).
TextTable refused_table(std::span<const DatasetEntry> entries);
// The 18 metrics, how the robot stands, and the detectors' share per robot: mean over the clips kept that have a value.
TextTable retargeting_table(std::span<const DatasetEntry> entries);
// Per format: clips, licence.
TextTable source_table(std::span<const DatasetEntry> entries);

}  // namespace duet
