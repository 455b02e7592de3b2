#include "duet/metrics/catalogue.h"

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

#include "duet/core/names.h"

namespace duet {
namespace {

constexpr auto kDown = Direction::kLower;
constexpr auto kUp = Direction::kHigher;
constexpr auto kPlain = Direction::kNone;
constexpr auto kRetarget = MetricGroup::kRetargeting;
constexpr auto kOther = MetricGroup::kOtherReading;
constexpr auto kStanding = MetricGroup::kGrounding;
constexpr auto kThing = MetricGroup::kObject;
constexpr auto kControl = MetricGroup::kController;
constexpr auto kEpisode = MetricGroup::kEpisode;
constexpr std::string_view kC21 = "supplement C.2.1";
constexpr std::string_view kS4 = "supplement A.4.6, Table S4";
constexpr std::string_view kGround = "duet: how a retargeted motion stands (metrics/grounding.h)";
constexpr std::string_view kCarried = "duet: hands and a carried object (metrics/object_metrics.h)";
constexpr std::string_view kDetectors = "supplement C.3.1, Algorithms 1-6";
constexpr std::string_view kWalking = "duet: walking by command (metrics/locomotion.h)";
constexpr std::string_view kSafety = "duet: contact safety";
constexpr std::string_view kLimits =
    "duet: contact safety, table in the form of ISO/TS 15066, unverified unless it names who checked it";

constexpr auto kCatalogue = std::to_array<MetricInfo>({
    {"jpe", "m", kDown, kRetarget, "Joint position error", kC21},
    {"awd", "m", kDown, kRetarget, "Average workspace distance", kC21},
    {"contact_precision_0.2", "1", kUp, kRetarget, "Contact precision at 0.2 m", kC21},
    {"contact_recall_0.2", "1", kUp, kRetarget, "Contact recall at 0.2 m", kC21},
    {"contact_f1_0.2", "1", kUp, kRetarget, "Contact F1 at 0.2 m", kC21},
    {"contact_accuracy_0.2", "1", kUp, kRetarget, "Contact accuracy at 0.2 m", kC21},
    {"contact_precision_0.35", "1", kUp, kRetarget, "Contact precision at 0.35 m", kC21},
    {"contact_recall_0.35", "1", kUp, kRetarget, "Contact recall at 0.35 m", kC21},
    {"contact_f1_0.35", "1", kUp, kRetarget, "Contact F1 at 0.35 m", kC21},
    {"contact_accuracy_0.35", "1", kUp, kRetarget, "Contact accuracy at 0.35 m", kC21},
    {"contact_precision_0.5", "1", kUp, kRetarget, "Contact precision at 0.5 m", kC21},
    {"contact_recall_0.5", "1", kUp, kRetarget, "Contact recall at 0.5 m", kC21},
    {"contact_f1_0.5", "1", kUp, kRetarget, "Contact F1 at 0.5 m", kC21},
    {"contact_accuracy_0.5", "1", kUp, kRetarget, "Contact accuracy at 0.5 m", kC21},
    {"large_angle_ratio", "1", kDown, kRetarget, "Large-angle ratio", kC21},
    {"angle_std", "rad", kDown, kRetarget, "Angle standard deviation", kC21},
    {"jerk_mean", "m/s^3", kDown, kRetarget, "Jerk, mean", kC21},
    {"jerk_std", "m/s^3", kDown, kRetarget, "Jerk, standard deviation", kC21},

    {"jpe.pelvis", "m", kDown, kOther, "Joint position error, pelvis-aligned", kC21},
    {"large_angle_ratio.entry", "1", kDown, kOther, "Large-angle ratio, per joint", kC21},

    {"sole_height", "m", kDown, kStanding, "Soles off the floor while standing, median", kGround},
    {"sole_height_max", "m", kDown, kStanding, "Soles off the floor while standing, largest", kGround},
    {"foot_skate", "m/s", kDown, kStanding, "Skate of the soles in stance, mean", kGround},
    {"foot_skate_max", "m/s", kDown, kStanding, "Skate of the soles in stance, 99th percentile", kGround},
    {"penetration", "m", kDown, kStanding, "Robot in the partner, mean depth", kGround},
    {"penetration_max", "m", kDown, kStanding, "Robot in the partner, deepest", kGround},
    {"self_penetration_max", "m", kDown, kStanding, "Robot in itself, deepest", kGround},
    {"bone_change_max", "m", kDown, kStanding, "Partner's arm bones change, most", kGround},
    {"joint_speed_max", "rad/s", kDown, kStanding, "Joint speed, peak", kGround},
    {"joint_acceleration_max", "rad/s^2", kDown, kStanding, "Joint acceleration, peak", kGround},
    {"limit_violations", "1", kDown, kStanding, "Joint limits violated", kGround},
    {"speed_violations", "1", kDown, kStanding, "Limits of joint speed violated", kGround},
    {"root_roll_max", "rad", kDown, kStanding, "Roll of the base, peak", kGround},
    {"root_tilt_max", "rad", kDown, kStanding, "Tilt of the base, peak", kGround},

    {"object_distance_error", "m", kDown, kThing, "Hand to object, change of distance", kCarried},
    {"object_distance_error.partner", "m", kDown, kThing, "Partner's hand to object, change of distance", kCarried},
    {"object_contact_f1_0.2", "1", kUp, kThing, "Hand on object F1 at 0.2 m", kCarried},
    {"object_contact_f1_0.35", "1", kUp, kThing, "Hand on object F1 at 0.35 m", kCarried},
    {"object_contact_f1_0.5", "1", kUp, kThing, "Hand on object F1 at 0.5 m", kCarried},

    {"hf_ratio", "1", kDown, kControl, "Joint-velocity energy above 5 Hz", kS4},
    {"dof_jerk", "rad/s^3", kDown, kControl, "Joint jerk", kS4},
    {"root_jerk", "m/s^3", kDown, kControl, "Root jerk", kS4},
    {"root_error", "m", kDown, kControl, "Root position error", kS4},
    {"root_error.horizontal", "m", kDown, kControl, "Root position error along the floor", "duet: a part of e_root"},
    {"root_error.vertical", "m", kDown, kControl, "Root position error in height", "duet: a part of e_root"},
    {"root_angle_error", "deg", kDown, kControl, "Root orientation error", kS4},
    {"dof_error", "rad", kDown, kControl, "Joint position tracking error", kS4},
    {"dof_velocity_error", "rad/s", kDown, kControl, "Joint velocity tracking error", kS4},
    {"hf_ratio_reference", "1", kDown, kControl, "Joint-velocity energy above 5 Hz, before the controller", kS4},
    {"dof_jerk_reference", "rad/s^3", kDown, kControl, "Joint jerk before the controller", kS4},
    {"root_jerk_reference", "m/s^3", kDown, kControl, "Root jerk before the controller", kS4},

    {"success", "1", kUp, kEpisode, "Success", kDetectors},
    {"success_lift", "1", kUp, kEpisode, "Success over the null arm", "duet: control arms"},
    {"fell", "1", kDown, kEpisode, "Falls", "duet: outcomes"},
    {"time_to_fall", "s", kUp, kEpisode, "Time to fall", "duet: outcomes"},
    {"evidence_frames", "1", kPlain, kEpisode, "Frames of evidence", kDetectors},
    {"contact_peak_force", "N", kDown, kEpisode, "Peak contact force on a region of the partner", kSafety},
    {"contact_quasi_static_force", "N", kDown, kEpisode, "Contact force held for more than 0.5 s", kSafety},
    {"contact_impulse", "N s", kPlain, kEpisode, "Contact impulse with the partner", kSafety},
    {"contact_limit_ratio", "1", kDown, kEpisode, "Largest contact load over its limit", kLimits},
    {"late_plans", "1", kDown, kEpisode, "Ticks without a plan in time", "supplement F"},
    {"onset_s", "s", kPlain, kEpisode, "Onset of the robot's act", "duet: onset"},
    {"partner_onset_s", "s", kPlain, kEpisode, "Onset of the partner's act", "duet: onset"},
    {"speed_forward", "m/s", kPlain, kEpisode, "Mean speed forward, in the heading", kWalking},
    {"speed_sideways", "m/s", kPlain, kEpisode, "Mean speed to the left, in the heading", kWalking},
    {"turn_rate", "rad/s", kPlain, kEpisode, "Mean yaw rate", kWalking},
    {"drift", "m", kPlain, kEpisode, "Distance of the root's end from its start", kWalking},
    {"swing_height", "m", kPlain, kEpisode, "Mean height of swings of a foot", kWalking},
    {"closest_feet", "m", kUp, kEpisode, "Least distance of the feet over the ground", kWalking},
    {"upper_body_error", "rad", kDown, kEpisode, "Upper body's joint position error", kWalking},
    {"upper_body_rate_error", "rad/s", kDown, kEpisode, "Upper body's joint velocity error", kWalking},
    {"command_forward", "m/s", kPlain, kEpisode, "Commanded speed forward", kWalking},
    {"command_sideways", "m/s", kPlain, kEpisode, "Commanded speed to the left", kWalking},
    {"command_turn", "rad/s", kPlain, kEpisode, "Commanded yaw rate", kWalking},
    {"frames", "1", kPlain, kEpisode, "Frames", "duet: episode"},
    {"sim_s", "s", kPlain, kEpisode, "Simulated time", "duet: episode"},
    {"wall_s", "s", kPlain, kEpisode, "Wall time", "duet: episode"},
});

}  // namespace

std::span<const MetricInfo> metric_catalogue() { return kCatalogue; }

const MetricInfo& metric_info(std::string_view name) {
  for (const MetricInfo& info : kCatalogue)
    if (info.name == name) return info;
  std::vector<std::string> names;
  names.reserve(kCatalogue.size());
  for (const MetricInfo& info : kCatalogue) names.emplace_back(info.name);
  throw std::invalid_argument(unknown_name_message("metric", name, names));
}

const MetricInfo& metric_of_reading(std::string_view name) {
  const MetricInfo* found = nullptr;
  for (const MetricInfo& info : kCatalogue) {
    const bool fits = name == info.name || (name.starts_with(info.name) && name[info.name.size()] == '.');
    if (fits && (found == nullptr || info.name.size() > found->name.size())) found = &info;
  }
  return found != nullptr ? *found : metric_info(name);
}

}  // namespace duet
