#include "duet/app/retarget_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/backends/physics_backend.h"
#include "duet/core/machine.h"
#include "duet/metrics/locomotion.h"
#include "duet/metrics/retargeting.h"
#include "duet/report/tables/text_table.h"
#include "duet/retarget/solver/pair.h"

namespace duet {
namespace {

struct ShownFigure {
  const char* name;
  const char* title;
  double factor;
  bool worst;  // whether the worst clip is of interest
};
constexpr ShownFigure kShownMetrics[] = {
    {"sole_height", "soles over the floor while standing, median [cm]", 100.0, true},
    {"sole_height_max", "the same, highest frame [cm]", 100.0, true},
    {"foot_skate", "skate in stance [cm/s]", 100.0, true},
    {"penetration", "robot in partner, mean depth [cm]", 100.0, true},
    {"penetration_max", "robot in partner, deepest [cm]", 100.0, true},
    {"self_penetration_max", "robot in itself, deepest [cm]", 100.0, true},
    {"bone_change_max", "partner's bones change by [cm]", 100.0, true},
    {"joint_speed_max", "joint speed, peak [rad/s]", 1.0, true},
    {"joint_acceleration_max", "joint acceleration, peak [rad/s^2]", 1.0, true},
    {"limit_violations", "limit violations", 1.0, true},
    {"speed_violations", "limits of joint speed violated", 1.0, true},
    {"root_roll_max", "roll of the base, peak [deg]", 57.29577951308232, true},
    {"root_tilt_max", "tilt of the base, peak [deg]", 57.29577951308232, true},
    {"jpe", "JPE [cm]", 100.0, true},
    {"awd", "AWD [cm]", 100.0, true},
    {"contact_f1_0.2", "contact F1 at 0.2 m", 1.0, false},
    {"contact_f1_0.35", "contact F1 at 0.35 m", 1.0, false},
    {"contact_f1_0.5", "contact F1 at 0.5 m", 1.0, false},
    {"object_distance_error", "hand to object, distance changes by [cm]", 100.0, true},
    {"object_distance_error.partner", "the same of the partner [cm]", 100.0, true},
    {"object_contact_f1_0.2", "hand on object F1 at 0.2 m", 1.0, false},
    {"object_contact_f1_0.35", "hand on object F1 at 0.35 m", 1.0, false},
    {"object_contact_f1_0.5", "hand on object F1 at 0.5 m", 1.0, false}};
constexpr const char* kF1[] = {"contact_f1_0.2", "contact_f1_0.35", "contact_f1_0.5"};

struct ClipFigures {
  std::map<std::string, double> figures;
  std::array<ContactCounts, 3> contacts, object_contacts;
  bool object = false;
  double seconds = 0.0;
  int frames = 0;
};

ClipFigures figures_of(const InteractionClip& clip, const RetargetVariant& variant, const RobotModel& robot) {
  ClipFigures out;
  const double begin = thread_cpu_seconds();
  const PairedMotion motion = retarget(clip, robot, variant.options);
  out.seconds = thread_cpu_seconds() - begin;
  out.frames = motion.frames();
  out.figures = grounding_metrics(motion, robot);
  const std::map<std::string, double> metrics = retargeting_metrics(motion, robot);
  for (const char* name : {"jpe", "awd"}) out.figures[name] = metrics.at(name);
  out.figures["large_angle_ratio.entry"] = large_angle_ratio(hinge_magnitudes(motion.robot.q), LargeAngle::kEntry);
  out.contacts = retargeting_contact_counts(motion, robot);
  out.object = !motion.object.empty();
  if (!out.object) return out;
  out.figures.merge(object_metrics(motion, robot));
  out.object_contacts = object_contact_counts(motion, robot);
  return out;
}

ComparedVariant summary_of(const std::string& name, const std::vector<ClipFigures>& clips) {
  ComparedVariant out;
  out.name = name;
  out.clips = static_cast<int>(clips.size());
  double seconds = 0.0, frames = 0.0;
  std::array<ContactCounts, 3> contacts{}, object_contacts{};
  bool object = false;
  std::map<std::string, int> counts;
  for (const ClipFigures& clip : clips) {
    seconds += clip.seconds;
    frames += clip.frames;
    for (std::size_t i = 0; i < contacts.size(); ++i) contacts[i] += clip.contacts[i];
    for (std::size_t i = 0; i < contacts.size(); ++i) object_contacts[i] += clip.object_contacts[i];
    object = object || clip.object;
    for (const auto& [figure, value] : clip.figures) {
      if (!std::isfinite(value)) continue;
      ComparedFigure& sum = out.figures[figure];
      sum.mean += value;
      sum.worst = counts[figure]++ == 0 ? value : std::max(sum.worst, value);
    }
  }
  for (auto& [figure, sum] : out.figures) sum.mean /= counts[figure];
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const double f1 = classification(contacts[i]).f1;
    out.figures[kF1[i]] = {f1, f1};
    const double object_f1 = classification(object_contacts[i]).f1;
    if (object) out.figures[fmt::format("object_{}", kF1[i])] = {object_f1, object_f1};
  }
  out.frames_per_second = frames / seconds;
  return out;
}

std::string figure_text(const ComparedVariant& variant, const ShownFigure& figure) {
  const auto found = variant.figures.find(figure.name);
  if (found == variant.figures.end()) return "-";
  const double mean = figure.factor * found->second.mean;
  if (!figure.worst) return fmt::format("{:.3f}", mean);
  return fmt::format("{:.2f} ({:.2f})", mean, figure.factor * found->second.worst);
}

}  // namespace

std::vector<RetargetVariant> mode_variants(const std::vector<std::string>& modes, const PairChoices& choices) {
  std::vector<RetargetVariant> variants;
  for (const std::string& mode : modes) {
    PairChoices all = choices;
    all.emplace_back("mode", mode);
    variants.push_back({mode, make_pair_options(all)});
  }
  return variants;
}

std::vector<RetargetVariant> weight_variants(const PairOptions& options) {
  std::vector<RetargetVariant> variants = {{"as given", options}};
  const auto add = [&](const char* name, const std::vector<double PairWeights::*>& weights) {
    for (const double factor : {0.5, 2.0}) {
      variants.push_back({fmt::format("{} x {}", name, factor), options});
      for (double PairWeights::*weight : weights) variants.back().options.weights.*weight *= factor;
    }
  };
  add("w_kin", {&PairWeights::kin});
  add("w_con", {&PairWeights::con});
  add("w_hum", {&PairWeights::hum});
  add("w_reg", {&PairWeights::temp, &PairWeights::pose});
  return variants;
}

std::vector<ComparedVariant> compare_retargeting(const std::vector<InteractionClip>& clips,
                                                 const std::vector<RetargetVariant>& variants, const RobotModel& robot,
                                                 int threads, Progress& progress) {
  const int total = static_cast<int>(clips.size() * variants.size());
  std::vector<std::vector<ClipFigures>> figures(variants.size(), std::vector<ClipFigures>(clips.size()));
  progress.start("comparing", total, "clips");
  parallel_for_each(total, threads, [&](int i) {
    const std::size_t clip = static_cast<std::size_t>(i) / variants.size(), variant = i % variants.size();
    figures[variant][clip] = figures_of(clips[clip], variants[variant], robot);
    progress.advance();
  });
  progress.finish();
  std::vector<ComparedVariant> out;
  for (std::size_t i = 0; i < variants.size(); ++i) out.push_back(summary_of(variants[i].name, figures[i]));
  return out;
}

std::string comparison_table(const std::vector<ComparedVariant>& compared) {
  TextTable table;
  table.header = {"Mean over clips (worst clip)"};
  for (const ComparedVariant& variant : compared) table.header.push_back(variant.name);
  const auto is_of_an_object = [](const ShownFigure& figure) {
    return std::string_view(figure.name).starts_with("object_");
  };
  const bool object = std::any_of(compared.begin(), compared.end(), [](const ComparedVariant& variant) {
    return variant.figures.contains("object_distance_error");
  });
  for (const ShownFigure& figure : kShownMetrics) {
    if (is_of_an_object(figure) && !object) continue;
    table.rows.push_back({figure.title});
    for (const ComparedVariant& variant : compared) table.rows.back().push_back(figure_text(variant, figure));
  }
  table.rows.push_back({"frames/s of one thread, clip to motion"});
  for (const ComparedVariant& variant : compared)
    table.rows.back().push_back(fmt::format("{:.0f}", variant.frames_per_second));
  return markdown_table(table);
}

std::string weights_table(const std::vector<ComparedVariant>& compared) {
  TextTable table;
  table.header = {"Weights", "JPE", "AWD", "F1 0.2", "F1 0.35", "F1 0.5", "Large-angle"};
  for (const ComparedVariant& variant : compared) {
    const auto mean = [&](const char* name) { return fmt::format("{:.4f}", variant.figures.at(name).mean); };
    table.rows.push_back({variant.name, mean("jpe"), mean("awd"), mean(kF1[0]), mean(kF1[1]), mean(kF1[2]),
                          mean("large_angle_ratio.entry")});
  }
  return markdown_table(table);
}

nlohmann::json comparison_json(const std::vector<ComparedVariant>& compared) {
  nlohmann::json out = nlohmann::json::array();
  for (const ComparedVariant& variant : compared) {
    nlohmann::json figures = nlohmann::json::object();
    for (const auto& [name, figure] : variant.figures) figures[name] = {{"mean", figure.mean}, {"worst", figure.worst}};
    out.push_back({{"name", variant.name},
                   {"clips", variant.clips},
                   {"frames_per_second", variant.frames_per_second},
                   {"figures", figures}});
  }
  return out;
}

}  // namespace duet
