// The words of suite files for what duet chooses by value.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "bench/suite.h"

namespace duet {

template <typename E>
using NameTable = std::vector<std::pair<std::string, E>>;

// What names combinations in tables, keys and file names: letters, digits and _ . + - only.
bool is_plain_name(std::string_view name);
std::string plain_name_message(std::string_view name);  // the sentence for one that is not

inline constexpr const char* kNullPolicy = "null";  // of the control arm
// Whether the value of an option of that name is a file.
bool is_path_option(std::string_view option);

const NameTable<SuiteStart>& start_names();
const NameTable<Side>& side_names();
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
