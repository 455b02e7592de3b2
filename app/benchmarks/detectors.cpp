#include "duet/app/benchmarks/benchmark.h"
#include "duet/core/parallel.h"
#include "duet/metrics/detector.h"
#include "duet/motion/synthesis/synthesis.h"

namespace duet {

ConfusionTable detector_confusion(int clips_per_task, int threads, ThresholdSet set) {
  const std::span<const Task> tasks = all_tasks();
  const int count = static_cast<int>(tasks.size());
  std::vector<std::vector<char>> accepted(tasks.size() * static_cast<size_t>(clips_per_task),
                                          std::vector<char>(tasks.size()));
  parallel_for_each(static_cast<int>(accepted.size()), threads, [&](int i) {
    SynthesisOptions options;
    options.index = i % clips_per_task;
    const InteractionClip clip = synthesize(tasks[i / clips_per_task], options);
    const Agent partner = human_agent(clip.actor_motion().joints);
    const Agent performer = human_agent(clip.reactor_motion().joints);
    for (int j = 0; j < count; ++j)
      accepted[i][j] = detect(tasks[j], partner, performer, DetectorVersion::kRobot, set).success ? 1 : 0;
  });
  ConfusionTable table;
  table.clips = clips_per_task;
  table.rate.assign(tasks.size(), std::vector<double>(tasks.size(), 0.0));
  table.tasks = task_names(tasks);
  for (size_t i = 0; i < accepted.size(); ++i)
    for (int j = 0; j < count; ++j)
      table.rate[i / clips_per_task][j] += accepted[i][j] / static_cast<double>(clips_per_task);
  return table;
}

}  // namespace duet
