// The source of the robot's reference: one 36-D reference a tick.
#pragma once

#include <string>

#include "duet/backends/backend.h"
#include "duet/core/robot_motion.h"
#include "duet/core/robot_state.h"
#include "duet/rollout/reference_stream.h"

namespace duet {

// The present, which is all that a source may look at. `partner` is null where nobody is there.
struct Present {
  int tick = 0;
  const RobotState& robot;
  const HumanJoints* partner = nullptr;
};

class ReferenceSource {
 public:
  virtual ~ReferenceSource() = default;
  // Called before tick 0, where engine and controller stand in `start`.
  virtual void begin(const RobotState& start) = 0;
  // The reference of this tick; ticks come in order from 0. Valid until the next call. Null: there is none any more.
  virtual const Reference* at(const Present& present) = 0;
  // Why there is no reference any more.
  [[nodiscard]] virtual std::string message() const { return ""; }
};

// A motion, its last frame held. Refers to it.
class MotionReference final : public ReferenceSource {
 public:
  explicit MotionReference(const RobotMotion& motion) : motion_(motion) {}
  void begin(const RobotState&) override {}
  const Reference* at(const Present& present) override;

 private:
  const RobotMotion& motion_;
  Reference reference_;
};

// A stream of references by command (rollout/reference_stream.h): it begins at the origin, heading along x.
class StreamReference final : public ReferenceSource {
 public:
  // Throws what ReferenceStream throws.
  StreamReference(std::shared_ptr<const RobotModel> robot, const StreamOptions& options, std::uint64_t seed);
  void begin(const RobotState& start) override;
  const Reference* at(const Present& present) override;
  [[nodiscard]] const ReferenceStream& stream() const { return stream_; }

 private:
  Random random_;
  ReferenceStream stream_;
};

}  // namespace duet
