// Whether the robot's joints can be where its states say: angles that jump, that stand still to the bit, whose speeds
// are not theirs, and that lie beyond the joint's limits. docs/hardware.md, "Timeouts". No allocation after
// construction. One owner, one thread.
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

// The doubts of now; the joint is the first of the first of these that is true, -1 where none is.
struct JointDoubts {
  bool jump = false;      // an angle went further than its joint can, and has not come back
  bool frozen = false;    // neither angle nor speed nor torque changes by a bit
  bool mismatch = false;  // a speed is not that of its angle
  double excess = 0.0;    // beyond a limit in each of the last three states, the largest [rad]
  int joint = -1;
};

class JointWatch {
 public:
  // `speeds`: of the joints, that they do not pass [rad/s].
  JointWatch(const RobotModel& robot, const Eigen::VectorXd& speeds);

  // A new state, `dt` after the one before by the robot's own count [s]. `learns`: nothing is commanded yet; how long
  // the joints of a robot that is well stand still to the bit is learnt then.
  void see(const Eigen::VectorXd& q, const Eigen::VectorXd& v, const Eigen::VectorXd& tau, double dt, bool learns);
  // The targets that were sent [rad]; of a robot that is damped, or not commanded, none are.
  void sent(const Eigen::VectorXd& targets);
  void sent_none();

  [[nodiscard]] const JointDoubts& doubts() const { return doubts_; }
  // Whether the angle of this joint is a jump's, and where it was before [rad].
  [[nodiscard]] bool jumped(int joint) const { return joints_[static_cast<std::size_t>(joint)].jumped; }
  [[nodiscard]] double before_jump(int joint) const { return joints_[static_cast<std::size_t>(joint)].q; }

 private:
  struct Joint {
    double lower = 0.0, upper = 0.0, speed = 0.0;  // limits
    double q = 0.0;                                // the last that was no jump's [rad]
    double seen_q = 0.0, seen_v = 0.0, seen_tau = 0.0;
    double off = 0.0, fastest = 0.0;  // angle less the way by its speed [rad], largest speed [rad/s]; both forget
    double target = kNotSent, target_at_rest = kNotSent;  // now; when the joint last changed by a bit
    int still = 0;                                        // states since then
    std::array<double, 3> excess{};                       // beyond its limits, the newest first [rad]
    bool jumped = false;
  };
  static constexpr double kNotSent = std::numeric_limits<double>::quiet_NaN();
  void begin(const Eigen::VectorXd& q, const Eigen::VectorXd& v, const Eigen::VectorXd& tau);
  static void see_motion(double q, double v, double dt, Joint& joint);
  static void see_bits(double q, double v, double tau, Joint& joint);
  static void see_range(double q, Joint& joint);
  void judge(bool learns);

  std::vector<Joint> joints_;
  int longest_still_ = 0;  // that was learnt of all joints at once
  bool any_ = false;
  JointDoubts doubts_;
};

}  // namespace duet
