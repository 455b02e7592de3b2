#include "duet/metrics/registry.h"

#include <memory>
#include <utility>

#include "duet/core/open_registry.h"
#include "duet/core/require.h"
#include "duet/metrics/retargeting.h"

namespace duet {
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

std::vector<std::string> catalogue_names() {
  std::vector<std::string> names;
  for (const MetricInfo& info : metric_catalogue()) names.emplace_back(info.name);
  return names;
}

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
