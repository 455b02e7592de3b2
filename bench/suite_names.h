// The words of suite files for what duet chooses by value.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "bench/suite.h"

namespace duet {

template <typename E>
using NameTable = std::vector<std::pair<std::string, E>>;

const NameTable<SuiteStart>& start_names();
const NameTable<PartnerMode>& partner_names();
const NameTable<RecordTrajectories>& record_names();
const NameTable<DetectorVersion>& version_names();
const NameTable<ThresholdSet>& threshold_names();

template <typename E>
std::string_view name_of(const NameTable<E>& table, E value) {
  for (const auto& [name, known] : table)
    if (known == value) return name;
  return "?";
}

}  // namespace duet
