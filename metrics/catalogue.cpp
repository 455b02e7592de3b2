#include "duet/metrics/catalogue.h"

#include <array>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/metrics/retargeting.h"

namespace duet {
namespace {

constexpr auto kDown = Direction::kLower;
constexpr auto kUp = Direction::kHigher;
constexpr auto kPlain = Direction::kNone;
constexpr auto kRetarget = MetricGroup::kRetargeting;
constexpr auto kOther = MetricGroup::kOtherReading;
constexpr auto kStandingGroup = MetricGroup::kGrounding;
constexpr auto kThing = MetricGroup::kObject;
constexpr auto kControl = MetricGroup::kController;
constexpr auto kEpisode = MetricGroup::kEpisode;
constexpr std::string_view kC21 = "supplement C.2.1";
constexpr std::string_view kS4 = "supplement A.4.6, Table S4";
constexpr std::string_view kGround = "duet: how a retargeted motion stands (metrics/locomotion.h)";
constexpr std::string_view kCarried = "duet: hands and a carried object (metrics/retargeting.h)";
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

    {"sole_height", "m", kDown, kStandingGroup, "Soles off the floor while standing, median", kGround},
    {"sole_height_max", "m", kDown, kStandingGroup, "Soles off the floor while standing, largest", kGround},
    {"foot_skate", "m/s", kDown, kStandingGroup, "Skate of the soles in stance, mean", kGround},
    {"foot_skate_max", "m/s", kDown, kStandingGroup, "Skate of the soles in stance, 99th percentile", kGround},
    {"penetration", "m", kDown, kStandingGroup, "Robot in the partner, mean depth", kGround},
    {"penetration_max", "m", kDown, kStandingGroup, "Robot in the partner, deepest", kGround},
    {"self_penetration_max", "m", kDown, kStandingGroup, "Robot in itself, deepest", kGround},
    {"bone_change_max", "m", kDown, kStandingGroup, "Partner's arm bones change, most", kGround},
    {"joint_speed_max", "rad/s", kDown, kStandingGroup, "Joint speed, peak", kGround},
    {"joint_acceleration_max", "rad/s^2", kDown, kStandingGroup, "Joint acceleration, peak", kGround},
    {"limit_violations", "1", kDown, kStandingGroup, "Joint limits violated", kGround},
    {"speed_violations", "1", kDown, kStandingGroup, "Limits of joint speed violated", kGround},
    {"root_roll_max", "rad", kDown, kStandingGroup, "Roll of the base, peak", kGround},
    {"root_tilt_max", "rad", kDown, kStandingGroup, "Tilt of the base, peak", kGround},

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

const MetricInfo& metric_info(std::string_view name) { return entry_named(kCatalogue, "metric", name); }

const MetricInfo& metric_of_reading(std::string_view name) {
  const MetricInfo* found = nullptr;
  for (const MetricInfo& info : kCatalogue) {
    const bool fits = name == info.name || (name.starts_with(info.name) && name[info.name.size()] == '.');
    if (fits && (found == nullptr || info.name.size() > found->name.size())) found = &info;
  }
  return found != nullptr ? *found : metric_info(name);
}

namespace {

// The texts that a MetricInfo only looks at.
struct MetricTexts {
  std::string name, unit, title, source;
};

struct AddedMetric {
  std::string name;
  std::unique_ptr<const MetricTexts> texts;
  MetricInfo info;
  MotionMetric metric;
};

// The one list that changes while a program runs: what a program adds has to be found by name wherever metrics are
// read.
OpenRegistry<AddedMetric>& added_metrics() {
  static OpenRegistry<AddedMetric> registry;
  return registry;
}

AddedMetric copied(const MetricInfo& info, MotionMetric metric) {
  auto texts = std::make_unique<const MetricTexts>(
      MetricTexts{std::string(info.name), std::string(info.unit), std::string(info.title), std::string(info.source)});
  const MetricInfo own = {texts->name,  texts->unit,  info.direction, MetricGroup::kRetargeting,
                          texts->title, texts->source};
  return {texts->name, std::move(texts), own, std::move(metric)};
}

std::vector<std::string> catalogue_names() { return names_of(metric_catalogue()); }

}  // namespace

void register_metric(const MetricInfo& info, MotionMetric metric) {
  require(metric != nullptr, "metric '" + std::string(info.name) + "': expected a function, found none");
  added_metrics().add("metric", copied(info, std::move(metric)), catalogue_names());
}

std::vector<MetricInfo> motion_metric_infos() {
  std::vector<MetricInfo> infos;
  for (const MetricInfo& info : metric_catalogue())
    if (info.group == MetricGroup::kRetargeting) infos.push_back(info);
  for (const AddedMetric* added : added_metrics().all()) infos.push_back(added->info);
  return infos;
}

std::map<std::string, double> score_motion(const PairedMotion& motion, const RobotModel& robot,
                                           const MetricReadings& readings) {
  std::map<std::string, double> scores = retargeting_metrics(motion, robot, readings);
  for (const AddedMetric* added : added_metrics().all()) scores[added->name] = added->metric(motion, robot);
  return scores;
}

}  // namespace duet
