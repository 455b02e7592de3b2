#include "duet/rollout/reference_source.h"

#include <algorithm>

namespace duet {

const Reference* MotionReference::at(const Present& present) {
  reference_ = motion_.reference(std::min(present.tick, motion_.frames() - 1));
  return &reference_;
}

StreamReference::StreamReference(std::shared_ptr<const RobotModel> robot, const StreamOptions& options,
                                 std::uint64_t seed)
    : random_(seed, stream_key({"stream", "reference"})), stream_(std::move(robot), options) {
  stream_.reset(random_);
}

void StreamReference::begin(const RobotState&) {}

const Reference* StreamReference::at(const Present& present) {
  if (present.tick > 0) stream_.advance(random_);
  return &stream_.reference();
}

}  // namespace duet
