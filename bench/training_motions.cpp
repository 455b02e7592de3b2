#include "bench/training_motions.h"

#include "bench/clips.h"
#include "policies/phase_adaptation.h"

namespace duet {

std::vector<RobotMotion> training_motions(const RobotModel& robot, int per_task, int threads, Progress& progress) {
  Suite suite = parse_suite(
      "schema: duet.suite/1\nname: training\nversion: 1.0.0\nengines: [playback]\n"
      "controllers: [pd]\npolicies: [replay]\n"
      "tasks: [hug, handshake, high_five, wave, bend, fly_kiss]\nclips: {synth: {per_task: 1}}\n",
      "training");
  suite.clips.synth_per_task = per_task;
  suite.clips.synth_seed = kTrainingSeed;
  std::vector<RobotMotion> motions;
  for (const PairedMotion& clip : prepare_clips(suite, robot, threads, progress)) {
    const AdaptationOptions options{.start = StartMode::kApproach};
    motions.push_back(adapt_by_phase(clip.robot, clip.phases, robot, options, kTrainingSeed + motions.size()).motion);
  }
  return motions;
}

}  // namespace duet
