// Walking as a plan: the root glides along walks, the feet are planted where the root will be in the middle of their
// stance. A planted foot does not move at all. Functions of time, evaluated in any order.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "duet/tasks/synthesis/posed_body.h"

namespace duet::synthesis {

// A person on the floor: position of the root and direction.
struct Placement {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  double yaw = 0.0;
};

// From standing, feet side by side, to standing, feet side by side.
struct Walk {
  double begin = 0.0, end = 0.0;  // [s]
  Placement from, to;
  Eigen::Vector2d bulge = Eigen::Vector2d::Zero();  // of the path at its middle, for arcs
  double turned_by = 1.0;                           // the turn is complete at this share of the time
  double moves_from = 0.0;                          // travelling begins at this share of the time
  int steps = 2;                                    // >= 2
  int first_foot = 0;

  [[nodiscard]] Placement at(double t) const;
  [[nodiscard]] double step_time() const { return (end - begin) / steps; }
  // Where the root is when step `i` carries the weight, that is what its foot is planted for.
  [[nodiscard]] Placement footfall(int i) const;
};

// One foot in the air. During [lift, land] its toe moves; its heel rises `roll_time` before that.
struct Swing {
  int foot = 0;
  double lift = 0.0, land = 0.0;  // [s]
  double roll_time = 0.0;
  double roll = 0.0;       // largest pitch [rad]
  double clearance = 0.0;  // of the toe [m]
  FootPose from, to;
};

class Gait {
 public:
  Gait(const Body& body, const Placement& start);
  // Appends; must begin where and after the last one ended.
  void walk(const Walk& walk);

  [[nodiscard]] Placement root(double t) const;
  [[nodiscard]] FootPose foot(int side, double t) const;
  // -1 ... 1: where the weight is while a foot is in the air, positive over the left foot; 0 in standing.
  [[nodiscard]] double weight(double t) const;
  [[nodiscard]] const std::vector<Swing>& swings() const { return swings_; }
  [[nodiscard]] const std::vector<Walk>& walks() const { return walks_; }

 private:
  [[nodiscard]] FootPose planted(const Placement& root, int side) const;

  double half_width_, ankle_back_, toe_out_, leg_;
  Eigen::Vector3d toe_offset_;
  double toe_height_;
  Placement start_;
  std::array<FootPose, 2> standing_;  // where the feet are after the last walk
  std::array<FootPose, 2> first_;
  std::vector<Walk> walks_;
  std::vector<Swing> swings_;  // in the order of landing
};

// Usual step length at a walking speed: the walk ratio (step length / cadence) of adults is constant, 0.0065 m min
// (Sekiya and Nagasaki 1998), scaled with leg length. [m]
double step_length(const Body& body, double speed);

// Takes as many steps as the walk needs: the walker's cadence at `speed`, no step longer than a comfortable one, no
// step turning by more than a quarter; makes the walk longer where its steps would be hasty.
void choose_steps(const Body& body, double speed, Walk& walk);

// A walk along an arc whose highest speed is `speed`, unless it is so short that this would take hasty steps; begins
// with the foot on the outer side.
Walk plan_walk(const Body& body, const Placement& from, const Placement& to, double speed, double begin);

// Smallest signed difference to - from. [rad]
double turn_between(double from, double to);

}  // namespace duet::synthesis
