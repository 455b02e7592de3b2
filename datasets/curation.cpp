#include "duet/datasets/curation.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "duet/core/names.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/metrics/detector.h"
#include "duet/motion/plausibility.h"
#include "duet/report/page/key_frames.h"
#include "duet/report/tables/line_plot.h"

namespace duet {
namespace {

// A figure over time and the frame where it is worst.
struct Worst {
  double value = 0.0;
  int frame = 0;
};

using Measure = Worst (*)(const InteractionClip& clip);

// A single frame that is off makes two steps that are too long; the third is an error of the clip.
constexpr int kStepsOfNoise = 2;

constexpr double kShortestAcross = 0.01;  // of the lines of hips and shoulders together, from above [m]

// The worst of both people: `of(person)`.
template <typename F>
Worst worse(const InteractionClip& clip, F&& of) {
  const Worst a = of(clip.a), b = of(clip.b);
  return a.value >= b.value ? a : b;
}

// The `share` quantile of values over time and joints, and the frame of the largest.
Worst tail(const std::vector<double>& values, int per_frame, double share) {
  const auto largest = std::max_element(values.begin(), values.end());
  return {quantile(values, share), static_cast<int>((largest - values.begin()) / per_frame)};
}

Worst joint_speed(const InteractionClip& clip) {
  return worse(clip, [](const HumanMotion& motion) {
    std::vector<Worst> steps;
    for (int t = 0; t + 1 < motion.frames(); ++t) {
      const Eigen::Matrix3Xd step = motion.joints.frame(t + 1) - motion.joints.frame(t);
      steps.push_back({motion.rate_hz * step.colwise().norm().maxCoeff(), t});
    }
    const auto third = steps.begin() + std::min(kStepsOfNoise, static_cast<int>(steps.size()) - 1);
    std::nth_element(steps.begin(), third, steps.end(),
                     [](const Worst& x, const Worst& y) { return x.value > y.value; });
    return *third;
  });
}

// The deviation from a bone's median length, over the bones from shoulders to wrists and hips to ankles.
Worst bone_change(const InteractionClip& clip) {
  constexpr std::array<int, 8> kEnds = {kLeftElbow, kRightElbow, kLeftWrist, kRightWrist,
                                        kLeftKnee,  kRightKnee,  kLeftAnkle, kRightAnkle};
  return worse(clip, [&](const HumanMotion& motion) {
    std::vector<double> change(static_cast<std::size_t>(motion.frames()) * kEnds.size());
    for (std::size_t e = 0; e < kEnds.size(); ++e) {
      std::vector<double> length(motion.frames());
      for (int t = 0; t < motion.frames(); ++t)
        length[t] = (motion.joints.at(t, kEnds[e]) - motion.joints.at(t, kSmplParents[kEnds[e]])).norm();
      const double usual = quantile(length, 0.5);
      for (int t = 0; t < motion.frames(); ++t) change[t * kEnds.size() + e] = std::abs(length[t] / usual - 1.0);
    }
    return tail(change, kEnds.size(), 0.95);
  });
}

// The swing of a person's heading within the act. A person who does a task to another faces him: a swing past a right
// angle is a tracker that took left for right where the bodies hide each other.
Worst act_turn(const InteractionClip& clip) {
  return worse(clip, [&](const HumanMotion& motion) {
    double lowest = 0.0, highest = 0.0, turned = 0.0, before = 0.0, fastest = 0.0;
    Worst worst{0.0, clip.phases.act_begin};  // the frame is that of the fastest turn
    bool first = true;
    for (int t = clip.phases.act_begin; t < clip.phases.act_end; ++t) {
      const Eigen::Vector3d left = motion.joints.at(t, kLeftHip) - motion.joints.at(t, kRightHip) +
                                   motion.joints.at(t, kLeftShoulder) - motion.joints.at(t, kRightShoulder);
      if (left.head<2>().norm() < kShortestAcross) continue;  // a frame without a heading
      const double heading = std::atan2(left.y(), left.x());
      const double turn = first ? 0.0 : std::remainder(heading - before, 2.0 * std::numbers::pi);
      first = false;
      before = heading;
      turned += turn;
      lowest = std::min(lowest, turned);
      highest = std::max(highest, turned);
      worst.value = highest - lowest;
      if (std::abs(turn) <= fastest) continue;
      fastest = std::abs(turn);
      worst.frame = t;
    }
    return worst;
  });
}

Worst implausible(const InteractionClip& clip) { return {static_cast<double>(judge_people(clip).faults.size()), 0}; }

// A person's waving hand need not be as high as the printed detector asks (.45 m over the root): in recordings it is at
// the chest, which is 0.31 m over the pelvis. The lowest of 19 recorded waves (Kinder) reaches 0.366 m.
constexpr double kChestWaveHeight = 0.35;
constexpr double kSeenLower = 0.5;  // the figure of a wave that is seen with that height alone

bool is_seen(const InteractionClip& clip, const Thresholds& tau) {
  const Agent a = human_agent(clip.a.joints), b = human_agent(clip.b.joints);
  return detect_performer(clip.task, a, b, tau).success || detect_performer(clip.task, b, a, tau).success;
}

// 1 where either person does the task to the other by its detector with the printed thresholds.
Worst task_seen(const InteractionClip& clip) {
  const int middle = (clip.phases.act_begin + clip.phases.act_end) / 2;
  Thresholds tau = thresholds(clip.task);
  if (is_seen(clip, tau)) return {1.0, middle};
  if (clip.task != Task::kWave) return {0.0, middle};
  tau.at("height") = kChestWaveHeight;
  return {is_seen(clip, tau) ? kSeenLower : 0.0, middle};
}

Worst act_seconds(const InteractionClip& clip) {
  return {(clip.phases.act_end - clip.phases.act_begin) / clip.rate_hz(), clip.phases.act_begin};
}

// The least height of the pelvis over the lower foot, against its 90th percentile: people who sit, lie or kneel.
Worst pelvis_height(const InteractionClip& clip) {
  Worst lowest{std::numeric_limits<double>::infinity(), 0};
  for (const HumanMotion* motion : {&clip.a, &clip.b}) {
    std::vector<double> height(motion->frames());
    for (int t = 0; t < motion->frames(); ++t)
      height[t] = motion->joints.at(t, kPelvis).z() -
                  std::min(motion->joints.at(t, kLeftAnkle).z(), motion->joints.at(t, kRightAnkle).z());
    const auto least = std::min_element(height.begin(), height.end());
    const double share = *least / quantile(height, 0.9);
    if (share < lowest.value) lowest = {share, static_cast<int>(least - height.begin())};
  }
  return lowest;
}

const HumanMotion& replaced(const InteractionClip& clip) { return clip.reactor_motion(); }

// The root's speed over half a second, horizontally.
Worst root_speed(const InteractionClip& clip) {
  const HumanMotion& motion = replaced(clip);
  const int window = std::min(std::max(1, static_cast<int>(0.5 * motion.rate_hz)), motion.frames() - 1);
  Worst fastest;
  for (int t = 0; t + window < motion.frames(); ++t) {
    const Eigen::Vector3d way = motion.joints.at(t + window, kPelvis) - motion.joints.at(t, kPelvis);
    const double speed = way.head<2>().norm() * motion.rate_hz / window;
    if (speed > fastest.value) fastest = {speed, t};
  }
  return fastest;
}

Worst trunk_lean(const InteractionClip& clip) {
  const HumanMotion& motion = replaced(clip);
  std::vector<double> lean(motion.frames());
  for (int t = 0; t < motion.frames(); ++t) {
    const Eigen::Vector3d trunk = motion.joints.at(t, kNeck) - motion.joints.at(t, kPelvis);
    lean[t] = std::atan2(trunk.head<2>().norm(), trunk.z());
  }
  return tail(lean, 1, 0.99);
}

Worst before_act(const InteractionClip& clip) { return {clip.phases.act_begin / clip.rate_hz(), 0}; }
Worst after_act(const InteractionClip& clip) {
  return {(clip.frames() - clip.phases.act_end) / clip.rate_hz(), clip.frames() - 1};
}

struct Criterion {
  CriterionInfo info;
  Measure measure;
};

constexpr std::array<Criterion, 11> kCriteria = {{
    {{"joint_speed", Gate::kMotionFidelity, "fastest joint, but for two frames", "m/s", 8.5, true}, joint_speed},
    {{"bone_change", Gate::kMotionFidelity, "change of a limb's bone, 95th percentile", "1", 0.5, true}, bone_change},
    {{"act_turn", Gate::kMotionFidelity, "swing of a person's heading within the act", "rad", 3.0, true}, act_turn},
    {{"implausible", Gate::kMotionFidelity, "people who cannot be (size, up, floor, sides)", "faults", 0.0, true},
     implausible},
    {{"task_seen", Gate::kInteractionClarity, "the task's detector sees it on the people", "1", kSeenLower, false},
     task_seen},
    {{"act_seconds", Gate::kInteractionClarity, "length of the act", "s", 0.2, false}, act_seconds},
    {{"pelvis_height", Gate::kKinematicFeasibility, "lowest pelvis, share of standing", "1", 0.5, false},
     pelvis_height},
    {{"root_speed", Gate::kKinematicFeasibility, "fastest root over 0.5 s of who the robot replaces", "m/s", 2.0, true},
     root_speed},
    {{"trunk_lean", Gate::kKinematicFeasibility, "deepest bow of who the robot replaces, 99th percentile", "rad", 1.5,
      true},
     trunk_lean},
    {{"before_act", Gate::kTemporalCompleteness, "time before the act", "s", 0.2, false}, before_act},
    {{"after_act", Gate::kTemporalCompleteness, "time after the act", "s", 0.2, false}, after_act},
}};

constexpr double kOfSource = 1.5;

double limit_of(const Criterion& criterion, const CurationOptions& options) {
  const auto set = options.limits.find(std::string(criterion.info.name));
  if (set != options.limits.end()) return set->second;
  if (criterion.measure != bone_change) return criterion.info.limit;
  return std::max(criterion.info.limit, kOfSource * options.source_bone_change);
}

CriterionFinding find(const Criterion& criterion, const InteractionClip& clip, const CurationOptions& options) {
  const Worst worst = criterion.measure(clip);
  CriterionFinding finding{.criterion = &criterion.info,
                           .value = worst.value,
                           .limit = limit_of(criterion, options),
                           .worst_frame = std::clamp(worst.frame, 0, clip.frames() - 1)};
  finding.passed = criterion.info.at_most ? finding.value <= finding.limit : finding.value >= finding.limit;
  return finding;
}

// How far a figure is from its limit, as a factor; larger is worse.
double excess(const CriterionFinding& finding) {
  const double over = finding.criterion->at_most ? finding.value : finding.limit;
  const double under = finding.criterion->at_most ? finding.limit : finding.value;
  return under > 0.0 ? over / under : std::numeric_limits<double>::infinity();
}

}  // namespace

std::string_view to_string(Gate gate) {
  switch (gate) {
    case Gate::kMotionFidelity:
      return "motion fidelity";
    case Gate::kInteractionClarity:
      return "interaction clarity";
    case Gate::kKinematicFeasibility:
      return "kinematic feasibility";
    case Gate::kTemporalCompleteness:
      return "temporal completeness";
  }
  return "";
}

std::span<const Gate> all_gates() {
  static constexpr std::array<Gate, 4> gates = {Gate::kMotionFidelity, Gate::kInteractionClarity,
                                                Gate::kKinematicFeasibility, Gate::kTemporalCompleteness};
  return gates;
}

std::span<const CriterionInfo> curation_criteria() {
  static const std::vector<CriterionInfo> criteria = [] {
    std::vector<CriterionInfo> infos;
    infos.reserve(kCriteria.size());
    for (const Criterion& criterion : kCriteria) infos.push_back(criterion.info);
    return infos;
  }();
  return criteria;
}

void set_limit(CurationOptions& options, const std::string& name, const std::string& value) {
  std::vector<std::string> known;
  known.reserve(kCriteria.size());
  for (const Criterion& criterion : kCriteria) known.emplace_back(criterion.info.name);
  require(std::ranges::count(known, name) > 0, unknown_name_message("curation criterion", name, known));
  const std::optional<double> limit = parse_number(value);
  require(limit.has_value(), "curation criterion '{}': expected a finite number, found '{}'", name, value);
  options.limits[name] = *limit;
}

bool CurationResult::passed() const {
  return std::ranges::all_of(findings, [](const CriterionFinding& finding) { return finding.passed; });
}

std::vector<Gate> CurationResult::refused_by() const {
  std::vector<Gate> gates;
  for (const CriterionFinding& finding : findings)
    if (!finding.passed && std::ranges::count(gates, finding.criterion->gate) == 0)
      gates.push_back(finding.criterion->gate);
  return gates;
}

std::vector<std::string> CurationResult::reasons() const {
  std::vector<std::string> sentences;
  for (const CriterionFinding& finding : findings)
    if (!finding.passed)
      sentences.push_back(fmt::format("{}: {:.3g} {}, expected {} {:g} (frame {})", finding.criterion->title,
                                      finding.value, finding.criterion->unit,
                                      finding.criterion->at_most ? "at most" : "at least", finding.limit,
                                      finding.worst_frame));
  return sentences;
}

int CurationResult::worst_frame() const {
  const CriterionFinding* worst = nullptr;
  for (const CriterionFinding& finding : findings)
    if (!finding.passed && (worst == nullptr || excess(finding) > excess(*worst))) worst = &finding;
  return worst == nullptr ? 0 : worst->worst_frame;
}

double limb_bone_change(const InteractionClip& clip) { return bone_change(clip).value; }

CurationResult curate(const InteractionClip& clip, const CurationOptions& options) {
  CurationResult verdict;
  for (const Criterion& criterion : kCriteria)
    if (std::ranges::count(options.gates, criterion.info.gate) > 0)
      verdict.findings.push_back(find(criterion, clip, options));
  return verdict;
}

namespace {

constexpr std::string_view kPictureStyle =
    "<style>.human{stroke:#2563a8}.robot{stroke:#c2410c}.far{opacity:.45}path,circle{fill:none;stroke-linecap:round}"
    "circle{stroke-width:30}.ground{stroke:#888}text{font-family:sans-serif;fill:#333}</style>";

StickFigure figure_of(const HumanMotion& motion, int frame, const std::string& label) {
  StickFigure figure{.label = label, .points = {}, .bones = {}};
  for (int j = 0; j < kSmplJoints; ++j) {
    figure.points.emplace_back(motion.joints.at(frame, j));
    if (kSmplParents[j] >= 0) figure.bones.emplace_back(kSmplParents[j], j);
  }
  return figure;
}

void replace_all(std::string& text, std::string_view from, std::string_view to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
}

}  // namespace

std::string clip_picture_svg(const InteractionClip& clip, const std::vector<int>& frames, const std::string& title) {
  std::vector<KeyFrame> key_frames;
  for (const int frame : frames) {
    require(frame >= 0 && frame < clip.frames(), "picture of clip '{}': frame {} is not among its {}", clip.id, frame,
            clip.frames());
    key_frames.push_back({.label = fmt::format("frame {} ({:.2f} s)", frame, frame / clip.rate_hz()),
                          .figures = {figure_of(clip.actor_motion(), frame, "human"),
                                      figure_of(clip.reactor_motion(), frame, "robot")}});
  }
  std::string svg = key_frames_svg(key_frames);
  if (svg.empty()) return svg;
  replace_all(svg, ">human<", ">stays human<");
  replace_all(svg, ">robot<", ">becomes the robot<");
  svg.insert(4, R"( xmlns="http://www.w3.org/2000/svg")");
  svg.insert(svg.find('>') + 1, fmt::format("{}<title>{}</title>", kPictureStyle, escape_html(title)));
  return svg;
}

}  // namespace duet
