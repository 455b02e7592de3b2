#include "metrics/detector_catalogue.h"

#include <fmt/format.h>

#include <array>
#include <numbers>
#include <stdexcept>

#include "core/names.h"
#include "metrics/detector.h"

namespace duet {
namespace {

constexpr Task kHug = Task::kHug, kShake = Task::kHandshake, kFive = Task::kHighFive, kWave = Task::kWave,
               kBend = Task::kBend, kKiss = Task::kFlyKiss;

constexpr auto kThresholds = std::to_array<ThresholdInfo>({
    {kHug, "hand_dist", 0.5, 0.5, "m", "double embrace: the two hands are nearer to one another"},
    {kHug, "body", 0.45, 0.45, "m", "double embrace: both hands are nearer to the torso; single embrace: one hand is"},
    {kHug, "shoulder", 0.4, 0.4, "m", "shoulder embrace: both hands are nearer to their nearer shoulder"},
    {kHug, "min_frames", 3, 25, "frames", "one way to embrace lasts so many frames on end"},

    {kShake, "contact", 0.3, 0.3, "m", "the nearest hands of the two are nearer"},
    {kShake, "min_contact", 10, 10, "frames", "frames of contact at a valid distance, also on end"},
    {kShake, "min_dist", 0.4, 0.4, "m", "the hand is at least so far from the performer's root"},
    {kShake, "max_dist", 1.5, 1.5, "m", "the hand is at most so far from the performer's root"},
    {kShake, "std_contact", 0.15, 0.15, "m", "standard deviation of the hands' distance in contact is below"},
    {kShake, "mean_contact", 0.45, 0.45, "m", "mean of the hands' distance in contact is below"},

    {kFive, "contact", 0.4, 0.15, "m", "the nearest hands of the two are nearer"},
    {kFive, "min_approach", 1, 1, "frames", "frames of contact at a valid height, at least"},
    {kFive, "max_sustained", 1000, 50, "frames", "such frames on end, at most"},
    {kFive, "height", 0.3, 0.3, "m", "both hands are at least so high above the performer's root"},

    {kWave, "motion_dist", 0.5, 0.5, "m", "path of the hand that moves more is longer"},
    {kWave, "min_changes", 3, 3, "1", "changes of its direction, at least"},
    {kWave, "amplitude", 0.3, 0.3, "m", "its peak to peak, at least"},
    {kWave, "angle", 0.785, 0.785, "rad", "a change of direction turns by more"},
    {kWave, "height", 0.45, 0.45, "m", "the higher hand is at least so high above the root, at its highest"},
    {kWave, "displacement", 0.005, 0.005, "m", "a change of direction counts where the step after it is longer"},

    {kBend, "min_angle", 0.349, std::numbers::pi / 6, "rad", "the trunk is inclined by at least"},
    {kBend, "min_frames", 5, 5, "frames", "frames of such inclination, at least"},

    {kKiss, "hand2head", 0.3, 0.2, "m", "a hand comes to the head, at most so far from it"},
    {kKiss, "forward_thresh", 0.1, 0.1, "m", "the hand's forward motion in all, at least"},
    {kKiss, "min_forward", 5, 5, "frames", "forward steps on end, at least"},
});

constexpr auto kFigures = std::to_array<DetectorFigure>({
    {kHug, "double_run", "frames", "longest run of the double embrace"},
    {kHug, "single_run", "frames", "longest run of the single embrace"},
    {kHug, "shoulder_run", "frames", "longest run of the shoulder embrace"},
    {kHug, "hands_distance_min", "m", "least distance of the two hands from one another"},
    {kHug, "torso_distance_min", "m", "least distance of the nearer hand from the torso"},
    {kHug, "torso_distance_both_min", "m", "least distance from the torso that both hands keep at once"},
    {kHug, "shoulder_distance_min", "m", "least distance of the nearer hand from its nearer shoulder"},
    {kHug, "shoulder_distance_both_min", "m",
     "least distance from their nearer shoulders that both hands keep at once: decides under hug.shoulder=both_hands"},

    {kShake, "distance_min", "m", "least distance of the nearest hands"},
    {kShake, "valid_contact_count", "frames", "frames of contact at a valid distance"},
    {kShake, "max_consecutive", "frames", "the most of them on end"},
    {kShake, "root_distance_min", "m",
     "least distance of hand and root (of the roots: handshake.distance=agent_roots)"},
    {kShake, "root_distance_max", "m", "largest such distance"},
    {kShake, "stability_std", "m", "standard deviation of the hands' distance in contact"},
    {kShake, "stability_mean", "m", "mean of the hands' distance in contact"},

    {kFive, "distance_min", "m", "least distance of the nearest hands"},
    {kFive, "contact_count", "frames", "frames of contact at a valid height"},
    {kFive, "consecutive_count", "frames", "the most of them on end"},
    {kFive, "height_max", "m", "largest height of the judged hands above the performer's root"},

    {kWave, "motion_total", "m", "path of the hand that moves more"},
    {kWave, "direction_changes", "1", "counted changes of its direction"},
    {kWave, "amplitude", "m", "its peak to peak"},
    {kWave, "height", "m", "height of the judged hand above the root"},

    {kBend, "max_angle", "rad", "largest inclination of the trunk"},
    {kBend, "frames_above", "frames", "frames of enough inclination"},

    {kKiss, "head_distance_min", "m", "least distance of the active hand from the head"},
    {kKiss, "consecutive_forward", "frames", "most forward steps on end"},
    {kKiss, "total_forward_motion", "m", "forward motion of the hand in all"},
});

template <typename Entry>
const Entry& find_entry(std::span<const Entry> table, const char* kind, Task task, std::string_view name) {
  std::vector<std::string> known;
  for (const Entry& entry : table) {
    if (entry.task != task) continue;
    if (entry.name == name) return entry;
    known.emplace_back(entry.name);
  }
  throw std::invalid_argument(unknown_name_message(fmt::format("{} of {}", kind, to_string(task)), name, known));
}

}  // namespace

std::span<const ThresholdInfo> threshold_catalogue() { return kThresholds; }
std::span<const DetectorFigure> detector_figures() { return kFigures; }

const DetectorFigure& detector_figure(Task task, std::string_view name) {
  return find_entry(detector_figures(), "figure", task, name);
}

const ThresholdInfo& threshold_info(Task task, std::string_view name) {
  return find_entry(threshold_catalogue(), "threshold", task, name);
}

std::vector<std::pair<std::string, std::string>> strict_choices(Task task) {
  Readings strict;
  strict.detectors = strict_readings({});
  std::vector<std::pair<std::string, std::string>> choices;
  for (const std::string& option : reading_names())
    if (option.starts_with(std::string(to_string(task)) + ".") && reading(strict, option) != reading({}, option))
      choices.emplace_back(option, reading(strict, option));
  return choices;
}

}  // namespace duet
