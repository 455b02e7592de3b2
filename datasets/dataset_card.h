// The card of a data set: what is in it, where it came from, what was refused and why, how good the retargeting is, how
// to load it, what to be careful of. Markdown, and HTML that opens from disk.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "duet/datasets/entry.h"
#include "duet/report/tables/text_table.h"

namespace duet {

std::string dataset_card_markdown(std::span<const DatasetEntry> entries, const nlohmann::json& settings);
// Lies in the data set's folder, whose pictures of the worst frames it shows (24 at most).
std::string dataset_card_html(std::span<const DatasetEntry> entries, const nlohmann::json& settings);

// The tables of a data set, made of its entries alone.

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
// Per kind of what was made up: clips kept that have it, their share of those kept, mean share of their frames. Empty
// where nothing was.
TextTable made_up_table(std::span<const DatasetEntry> entries);
// Per format: clips, licence.
TextTable source_table(std::span<const DatasetEntry> entries);

// Names of a data set's files below its folder, and the files that are derived from its entries: they can be made again
// at any time.

std::string people_file(const std::string& clip);                           // "people/CLIP.npz"
std::string robot_file(const std::string& robot, const std::string& clip);  // "g1/CLIP.npz"
std::string rejected_file(const std::string& clip);                         // "rejected/CLIP.svg"

// manifest.json (the entries in the order of their ids), annotations.csv, tables/*.csv, card.md, card.html. The same
// entries give the same bytes. Throws StorageError.
void write_derived_files(const std::string& folder, const std::vector<DatasetEntry>& entries);

}  // namespace duet
