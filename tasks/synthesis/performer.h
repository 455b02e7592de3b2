// One person of a clip: body, walk, and what trunk, head and arms do when. The renderer turns it into joints.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "duet/tasks/synthesis/curves.h"
#include "duet/tasks/synthesis/gait.h"
#include "duet/tasks/synthesis/posed_body.h"

namespace duet::synthesis {

// Where an arm goes: holds (functions of the moment, often tied to the own or the partner's body) and the moves from
// one hold to the next.

// The values that a hold may look at. The figures have their torsos posed, not yet their arms.
struct Moment {
  double t = 0.0;
  int side = 0;  // of the arm
  const Body& body;
  const PosedBody& own;
  const PosedBody& partner;
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

// A set of the trunk that lets a hand reach a point.
struct Lean {
  double forward = 0.0;  // inclination of the trunk [rad]
  double side = 0.0;     // of the spine to the right [rad]
  double twist = 0.0;    // of the spine to the left [rad]
  double crouch = 0.0;   // of the pelvis below its standing height [m]
  double shift = 0.0;    // of the pelvis forward, feet planted [m]
  double hips = 0.0;     // of the pelvis over the feet to the left, the trunk with it [rad]
};

struct Performer {
  Performer(const Body& a_body, const Placement& start, const Hold& hang)
      : body(a_body), gait(a_body, start), arms{ArmTrack(hang), ArmTrack(hang)} {}

  // Moves every channel of the trunk at once, but for the hips.
  void lean_to(double begin, double end, const Lean& lean);

  Body body;
  Gait gait;
  Placement act;          // where the feet stand during the act
  double reaction = 0.0;  // how much later than A this person begins things [s]
  double arm_swing = 0.7;
  bool meets_skin = false;  // hands stop at the partner's trunk and head
  double aside = 0.0;       // of the hips to the left of trunk and feet, all the time [rad]
  double stoop = 0.0;       // forward, at which the trunk rests [rad]
  Channel forward, side, twist, crouch, shift, hips;
  Channel look{1.0};  // 1: at the partner, 0: straight ahead
  Channel nod;        // of the head, forward [rad]
  std::array<ArmTrack, 2> arms;
  std::array<Sway, 12> sway;
};

// Trunk of a standing person at `root`, set by `lean`; pelvis at `height` less the crouch.
TorsoPose standing_torso(const Body& body, const Placement& root, const Lean& lean, double height);

// The smallest lean beyond `from` (and crouch, when leaning is not enough) that brings `target` (of a person who stands
// at the origin facing +x) within `share` of the arm's length from the shoulder. Best effort where nothing does.
Lean lean_to_reach(const Body& body, int side, const Eigen::Vector3d& target, const Lean& from, double share);

// Shoulder of a person who stands at the origin facing +x.
Eigen::Vector3d shoulder_at(const Body& body, int side, const Lean& lean);

}  // namespace duet::synthesis
