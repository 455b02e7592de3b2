// Where an arm goes: holds (functions of the moment, often tied to the own or the partner's body) and the moves from
// one hold to the next.
#pragma once

#include <functional>
#include <vector>

#include "duet/tasks/synthesis/figure.h"

namespace duet::synthesis {

// The values that a hold may look at. The figures have their torsos posed, not yet their arms.
struct Moment {
  double t = 0.0;
  int side = 0;  // of the arm
  const Body& body;
  const Figure& own;
  const Figure& partner;
  double swing = 0.0;    // forward swing of the hanging arm in walking [rad]
  Eigen::Vector3d sway;  // slow unsteadiness of a free hand, in [-1, 1]
};

using Hold = std::function<ArmPose(const Moment&)>;

// How an arm hangs: `outward` from the body [rad]; `upright` 1 = plumb whatever the trunk does, 0 = along the trunk.
Hold hanging(double outward, double upright);

// Hand at an offset from the shoulder, in chest axes mirrored for the right arm, in units of the arm's length.
Hold from_shoulder(const Eigen::Vector3d& offset, const Eigen::Vector3d& pole, double wrist);

// Hand at a point of the world that may move.
Hold at_point(std::function<Eigen::Vector3d(double t)> point, const Eigen::Vector3d& pole, double wrist);

// A pole given in chest axes, mirrored for the right arm, in W.
Eigen::Vector3d chest_vector(const Moment& moment, const Eigen::Vector3d& left_arm_vector);

class ArmTrack {
 public:
  explicit ArmTrack(Hold rest) : rest_(std::move(rest)) {}
  // Goes over to `hold` during [begin, end] on a path of least jerk that swerves by `arc` (chest axes, mirrored for the
  // right arm) [m]. Throws std::invalid_argument where it would begin before the last move ended.
  void to(double begin, double end, Hold hold, const Eigen::Vector3d& arc = Eigen::Vector3d::Zero());
  void rest(double begin, double end, const Eigen::Vector3d& arc = Eigen::Vector3d::Zero()) {
    to(begin, end, rest_, arc);
  }
  [[nodiscard]] ArmPose at(const Moment& moment) const;
  [[nodiscard]] double free_at() const { return moves_.empty() ? 0.0 : moves_.back().end; }

 private:
  struct Move {
    double begin, end;
    Hold hold;
    Eigen::Vector3d arc;
  };
  Hold rest_;
  std::vector<Move> moves_;
};

}  // namespace duet::synthesis
