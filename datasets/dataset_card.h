// The card of a data set: what is in it, where it came from, what was refused and why, how good the retargeting is, how
// to load it, what to be careful of. Markdown, and HTML that opens from disk.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

#include "duet/datasets/entry.h"

namespace duet {

std::string dataset_card_markdown(std::span<const DatasetEntry> entries, const nlohmann::json& settings);
// Lies in the data set's folder, whose pictures of the worst frames it shows (24 at most).
std::string dataset_card_html(std::span<const DatasetEntry> entries, const nlohmann::json& settings);

}  // namespace duet
