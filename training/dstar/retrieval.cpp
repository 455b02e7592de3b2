#include "duet/training/dstar/retrieval.h"

#include <cmath>

#include "duet/core/require.h"

namespace duet {
namespace {

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
  batch.resize(windows);
  draw_windows(maker, all, random, batch);
  RetrievalLibrary library{robot->name, robot->joint_names(), batch.task, {}, {}, {}, batch.plan};
  library.keys.resize(kRetrievalKey, windows);
  for (int i = 0; i < windows; ++i) write_key(features_of(batch, i), library.keys.col(i));
  normalise(library);
  return library;
}

}  // namespace duet
