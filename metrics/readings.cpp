#include "duet/metrics/readings.h"

#include <algorithm>
#include <charconv>
#include <span>
#include <string_view>
#include <type_traits>

#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/tasks/task_definition.h"

namespace duet {
namespace {

// A choice is held as an int: the enumerator's value, which is `first` plus the place of its name.
struct Option {
  std::string_view name;
  std::string_view values;  // names of the readings, separated by blanks; "" where any whole number from 1 on will do
  int (*get)(const Readings&);
  void (*set)(Readings&, int);
  int first = 0;
};

template <auto Group, auto Member>
int get_member(const Readings& readings) {
  return static_cast<int>((readings.*Group).*Member);
}

template <auto Group, auto Member>
void set_member(Readings& readings, int value) {
  auto& member = (readings.*Group).*Member;
  member = static_cast<std::remove_reference_t<decltype(member)>>(value);
}

template <auto Group, auto Member>
constexpr Option option(std::string_view name, std::string_view values, int first = 0) {
  return {name, values, &get_member<Group, Member>, &set_member<Group, Member>, first};
}

constexpr auto kMetrics = &Readings::metrics;
constexpr auto kDetectorRules = &Readings::detectors;
constexpr auto kDiagnostics = &Readings::diagnostics;
using M = MetricReadings;
using D = DetectorReadings;
using G = DiagnosticReadings;

constexpr Option kOptions[] = {
    option<kMetrics, &M::jpe_frame>("metrics.jpe_frame", "world pelvis"),
    option<kMetrics, &M::awd_entries>("metrics.awd_entries", "full offdiag cross within"),
    option<kMetrics, &M::matching>(
        "metrics.matching",
        "independent_frame source_frame independent_sequence source_sequence independent_bottleneck"),
    option<kMetrics, &M::contact_compare>("metrics.contact_compare", "lt le"),
    option<kMetrics, &M::zero_division>("metrics.zero_division", "nan zero one"),
    option<kMetrics, &M::min_frames>("metrics.min_frames", ""),
    option<kMetrics, &M::large_angle>("metrics.large_angle", "frame_any entry frame_mean frame_all"),
    option<kMetrics, &M::angle_std>("metrics.angle_std", "pooled mean_of_joints"),
    option<kMetrics, &M::ddof>("metrics.ddof", "0 1"),
    option<kMetrics, &M::jerk_scheme>("metrics.jerk_scheme", "diff central gradient"),

    option<kDetectorRules, &D::hug_single>("hug.single", "any_hand same_hand exactly_one off"),
    option<kDetectorRules, &D::hug_shoulder>("hug.shoulder", "both_hands any_hand torso_both torso_any off"),
    option<kDetectorRules, &D::handshake_distance>("handshake.distance", "hand_to_root agent_roots"),
    option<kDetectorRules, &D::handshake_active>("handshake.active", "performer_hand partner_hand"),
    option<kDetectorRules, &D::handshake_stability>("handshake.stability", "whole rolling_all rolling_any"),
    option<kDetectorRules, &D::handshake_stability_frames>("handshake.stability_frames", "raw validated"),
    option<kDetectorRules, &D::handshake_ddof>("handshake.ddof", "0 1"),
    option<kDetectorRules, &D::high_five_height>(
        "high_five.height", "closest_pair performer_closest partner_closest any_hand performer_any off"),
    option<kDetectorRules, &D::wave_plane>("wave.plane", "xy lateral_up pca"),
    option<kDetectorRules, &D::wave_displacement>("wave.displacement", "step both_steps since_last none"),
    option<kDetectorRules, &D::wave_amplitude>("wave.amplitude", "max_axis diagonal diameter horizontal"),
    option<kDetectorRules, &D::wave_height>("wave.height", "any_hand_max active_max active_mean active_median"),
    option<kDetectorRules, &D::wave_frame>("wave.frame", "world root"),
    option<kDetectorRules, &D::bend_frames>("bend.frames", "count consecutive"),
    option<kDetectorRules, &D::bend_direction>("bend.direction", "any forward"),
    option<kDetectorRules, &D::fly_kiss_order>("fly_kiss.order", "whole after_closest after_first_close"),
    option<kDetectorRules, &D::fly_kiss_dir>("fly_kiss.dir", "space horizontal"),
    option<kDetectorRules, &D::fly_kiss_frame>("fly_kiss.frame", "world root"),

    option<kDiagnostics, &G::velocity>("diagnostics.velocity", "diff gradient given"),
    option<kDiagnostics, &G::spectrum>("diagnostics.spectrum", "periodogram hann welch butterworth"),
    option<kDiagnostics, &G::mean>("diagnostics.mean", "keep remove"),
    option<kDiagnostics, &G::edge>("diagnostics.edge", "above at_or_above"),
    option<kDiagnostics, &G::pool>("diagnostics.pool", "energy mean_of_joints"),
    option<kDiagnostics, &G::dof_jerk>("diagnostics.dof_jerk", "mean_abs mean_norm rms"),
    option<kDiagnostics, &G::root_jerk>("diagnostics.root_jerk", "mean_norm rms",
                                        static_cast<int>(JerkNorm::kMeanNorm)),
    option<kDiagnostics, &G::jerk_scheme>("diagnostics.jerk_scheme", "diff central gradient"),
    option<kDiagnostics, &G::dof_error>("diagnostics.dof_error", "mean_abs mean_norm rms"),
};

const Option& find_option(const std::string& name) { return entry_named(kOptions, "reading option", name); }

std::vector<std::string> split(std::string_view names) {
  std::vector<std::string> parts;
  while (!names.empty()) {
    const size_t blank = std::min(names.find(' '), names.size());
    parts.emplace_back(names.substr(0, blank));
    names.remove_prefix(std::min(blank + 1, names.size()));
  }
  return parts;
}

int parse_count(const Option& option, const std::string& value) {
  int number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  require(error == std::errc() && end == value.data() + value.size() && number >= 1,
          "reading '{}' of {}: expected a whole number from 1 on", value, option.name);
  return number;
}

}  // namespace

void set_reading(Readings& readings, const std::string& option, const std::string& value) {
  const Option& found = find_option(option);
  if (found.values.empty()) {
    found.set(readings, parse_count(found, value));
    return;
  }
  const std::vector<std::string> known = split(found.values);
  const auto place = std::find(known.begin(), known.end(), value);
  if (place == known.end()) throw std::invalid_argument(unknown_name_message("reading of " + option, value, known));
  found.set(readings, found.first + static_cast<int>(place - known.begin()));
}

std::string reading(const Readings& readings, const std::string& option) {
  const Option& found = find_option(option);
  const int value = found.get(readings);
  return found.values.empty() ? std::to_string(value) : split(found.values).at(value - found.first);
}

std::vector<std::string> reading_names() { return names_of(kOptions); }

std::vector<std::string> reading_values(const std::string& option) {
  const Option& found = find_option(option);
  return found.values.empty() ? std::vector<std::string>{reading(Readings{}, option)} : split(found.values);
}

DetectorReadings strict_readings(DetectorReadings readings) {
  for (const Task task : all_tasks())
    if (const auto read_strictly = definition_of(task).detector.read_strictly) read_strictly(readings);
  return readings;
}

}  // namespace duet
