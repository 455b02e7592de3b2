// The words of suite files for what duet chooses by value.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/backends/scene.h"
#include "duet/metrics/detector.h"
#include "duet/motion/synthesis_options.h"

namespace duet {

// auto: act where the controller cannot walk, else approach
enum class SuiteStart { kAuto, kClip, kApproach, kAct, kSimToReal };
enum class RecordTrajectories { kNone, kFailures, kAll };
enum class ClipRoles { kOwn, kBoth };  // whom the robot replaces: whom the clip says, or each person in turn

template <typename E>
using NameTable = std::vector<std::pair<std::string, E>>;

inline constexpr const char* kNullPolicy = "null";  // of the control arm
// Whether the value of an option of that name is a file.
bool is_path_option(std::string_view option);

const NameTable<SuiteStart>& start_names();
const NameTable<Side>& side_names();
const NameTable<ActOutcome>& act_outcome_names();
const NameTable<ClipRoles>& role_names();
const NameTable<Likeness>& likeness_names();  // "rehearsed", "people"
const NameTable<PartnerMode>& partner_names();
const NameTable<RecordTrajectories>& record_names();
const NameTable<DetectorVersion>& version_names();
const NameTable<ThresholdSet>& threshold_names();

std::string_view to_string(SuiteStart start);
std::string_view to_string(PartnerMode partner);

// Its names in the order of the enumerators, which count from 0: the choices of a field (core/field.h).
template <typename E>
std::vector<std::string> choices_of(const NameTable<E>& table) {
  std::vector<std::string> names(table.size());
  for (const auto& [name, value] : table) names.at(static_cast<std::size_t>(value)) = name;
  return names;
}

template <typename E>
std::string_view name_of(const NameTable<E>& table, E value) {
  for (const auto& [name, known] : table)
    if (known == value) return name;
  return "?";
}

}  // namespace duet
