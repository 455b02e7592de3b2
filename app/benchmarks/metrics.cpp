#include "duet/app/benchmarks/parts.h"
#include "duet/app/benchmarks/timer.h"
#include "duet/metrics/detector.h"
#include "duet/metrics/retargeting.h"
#include "duet/retarget/pair.h"

namespace duet {
namespace {

std::vector<BenchmarkFigure> time_metrics(const BenchmarkOptions& options) {
  const RobotModel robot = load_robot(default_card_path());
  const PairedMotion motion = retarget(benchmark_clip(), robot);
  const double seconds = best_call_seconds([&] { retargeting_metrics(motion, robot); }, options.seconds);
  return {at_most("metrics/retargeting", 1e3 * seconds, "ms", 5.0)};
}

std::vector<BenchmarkFigure> time_detectors(const BenchmarkOptions& options) {
  const InteractionClip clip = benchmark_clip();
  const Agent a = human_agent(clip.a.joints);
  const Agent b = human_agent(clip.b.joints);
  const double seconds = best_call_seconds(
      [&] {
        for (const Task task : kPaperTasks) detect(task, a, b, DetectorVersion::kRobot);
      },
      options.seconds);
  return {at_most("metrics/detectors", 1e3 * seconds, "ms", 1.0)};
}

}  // namespace

void add_metrics_benchmarks(std::vector<Benchmark>& list) {
  list.push_back({"metrics/retargeting", "the 18 metrics on a clip of 1,007 frames", time_metrics});
  list.push_back({"metrics/detectors", "all six detectors on a clip of 1,007 frames", time_detectors});
}

}  // namespace duet
