#include "training/dstar/retrieval.h"

#include <cmath>

#include "core/require.h"

namespace duet {
namespace {

DstarFeatures features_of(const WindowBatch& batch, int column) {
  DstarFeatures features;
  features.frames = batch.frames.col(column).reshaped(kFrameSize, kHistoryFrames);
  features.position = batch.position.col(column);
  features.distance = batch.distance.col(column);
  features.orientation = batch.orientation.col(column);
  return features;
}

void normalise(RetrievalLibrary& library) {
  library.mean = library.keys.rowwise().mean();
  library.keys.colwise() -= library.mean;
  library.deviation =
      (library.keys.rowwise().norm() / std::sqrt(static_cast<float>(library.windows()))).cwiseMax(0.01F);
  library.keys = library.keys.array().colwise() / library.deviation.array();
}

}  // namespace

RetrievalLibrary make_retrieval_library(const std::shared_ptr<const RobotModel>& robot, const DemonstrationSet& set,
                                        int windows, std::uint64_t seed) {
  const WindowOptions options{.augment = false};
  const std::vector<Window> all = list_windows(set, options);
  require(!all.empty(), "a library of demonstrations without a window");
  WindowMaker maker(robot, set, options);
  Random random(seed, stream_key({"retrieval"}));
  WindowBatch batch;
  batch.resize(1);
  RetrievalLibrary library{robot->name, robot->joint_names(), {}, {}, {}, {}, {}};
  library.keys.resize(kRetrievalKey, windows);
  library.plans.resize(kPlanSize, windows);
  for (int i = 0; i < windows; ++i) {
    maker.make(all[random.below(static_cast<int>(all.size()))], random, batch, 0);
    write_key(features_of(batch, 0), library.keys.col(i));
    library.plans.col(i) = batch.plan.col(0);
    library.tasks.push_back(batch.task[0]);
  }
  normalise(library);
  return library;
}

}  // namespace duet
