#include "duet/training/setup/training_motions.h"

#include "duet/experiment/plan/clips.h"
#include "duet/policies/phase_adaptation.h"

namespace duet {

std::vector<RobotMotion> training_motions(const RobotModel& robot, int per_task, int threads, Progress& progress) {
  std::vector<RobotMotion> motions;
  for (const PairedMotion& clip : synthetic_clips(robot, {}, {kPaperTasks.begin(), kPaperTasks.end()}, per_task,
                                                  kTrainingSeed, threads, progress)) {
    const AdaptationOptions options{.start = StartMode::kApproach};
    motions.push_back(adapt_by_phase(clip.robot, clip.phases, robot, options, kTrainingSeed + motions.size()).motion);
  }
  return motions;
}

}  // namespace duet
