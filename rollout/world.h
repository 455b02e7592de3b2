// Where an episode happens: an engine, nothing but the reference itself (playback), a robot behind its guard. The loop
// of rollout.h asks it once a tick, in this order: state, contacts, target, advance.
#pragma once

#include <span>
#include <string>

#include "duet/core/contact.h"
#include "duet/core/outcome.h"
#include "duet/core/point_tracks.h"
#include "duet/core/robot_state.h"
#include "duet/rollout/deadline.h"

namespace duet {

struct Rollout;

class World {
 public:
  virtual ~World() = default;
  // Puts the robot at the start, or waits until it is there. Throws where it cannot be.
  virtual void begin(const RobotState& start) = 0;
  [[nodiscard]] virtual const RobotState& state() const = 0;
  [[nodiscard]] virtual std::span<const Contact> contacts() const { return {}; }  // of the last physics step
  // The joint targets that are sent for this reference [rad]. Valid until the next call.
  virtual const Eigen::VectorXd& target(const Reference& reference) = 0;
  // The 20 ms of this tick. `partner`: SMPL joints, frame 0 at tick 0; empty: nobody.
  virtual Outcome advance(int tick, const PointTracks& partner, Deadline& deadline) = 0;
  // Why it ended the episode; empty: what the outcome says of itself.
  [[nodiscard]] virtual std::string message() const { return ""; }
  // Writes the world's measurements into the rollout.
  virtual void finish(Rollout&) const {}
};

}  // namespace duet
