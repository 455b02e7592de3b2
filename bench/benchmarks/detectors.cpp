#include "bench/benchmarks/benchmark.h"
#include "bench/parallel.h"
#include "metrics/detector.h"
#include "motion/synthesis.h"

namespace duet {

ConfusionTable detector_confusion(int clips_per_task, int threads, bool strict) {
  constexpr int kTaskCount = static_cast<int>(kTasks.size());
  const ThresholdSet set = strict ? ThresholdSet::kStrict : ThresholdSet::kPaper;
  std::vector<std::array<bool, kTaskCount>> accepted(static_cast<size_t>(clips_per_task) * kTaskCount);
  parallel_for_each(static_cast<int>(accepted.size()), threads, [&](int i) {
    SynthesisOptions options;
    options.index = i % clips_per_task;
    const InteractionClip clip = synthesize(kTasks[i / clips_per_task], options);
    const Agent partner = human_agent(clip.actor_motion().joints);
    const Agent performer = human_agent(clip.reactor_motion().joints);
    for (int j = 0; j < kTaskCount; ++j)
      accepted[i][j] = detect(kTasks[j], partner, performer, DetectorVersion::kRobot, set).success;
  });
  ConfusionTable table;
  table.clips = clips_per_task;
  table.rate.assign(kTaskCount, std::vector<double>(kTaskCount, 0.0));
  for (const Task task : kTasks) table.tasks.emplace_back(to_string(task));
  for (size_t i = 0; i < accepted.size(); ++i)
    for (int j = 0; j < kTaskCount; ++j)
      table.rate[i / clips_per_task][j] += accepted[i][j] / static_cast<double>(clips_per_task);
  return table;
}

}  // namespace duet
