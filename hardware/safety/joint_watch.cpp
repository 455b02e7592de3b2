#include "duet/hardware/safety/joint_watch.h"

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"

namespace duet {
namespace {

// Chosen so that a twin that walks under HOMIE's network with noisy sensors, and loses states, is far from each.
constexpr double kJump = 0.05;        // beyond the joint's speed between two states [rad]
constexpr double kNewStart = 0.1;     // without a state; then its angle may be any [s]
constexpr double kForget = 0.5;       // speeds and ways [s]
constexpr double kMismatch = 0.1;     // [rad]
constexpr double kSpeedLag = 0.05;    // by which a measured speed may lag behind its angle [s]
constexpr double kTargetMoved = 0.1;  // while its joint did not change by a bit [rad]
constexpr double kMostSpeed = 100.0;  // that is believed for the two above: one glitch is soon forgotten [rad/s]
constexpr int kStillStates = 25;      // in which a joint did not change by a bit
constexpr int kMostLearnt = 10;       // longer: a robot without noise, of which standing still says nothing
constexpr int kStillShare = 10;       // so many times the longest that was learnt

}  // namespace

JointWatch::JointWatch(const RobotModel& robot, const Eigen::VectorXd& speeds) {
  require(speeds.size() == robot.dof(), "joint watch: expected a speed for each of {} joints, found {}", robot.dof(),
          speeds.size());
  joints_.resize(static_cast<std::size_t>(robot.dof()));
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    joints_[j].lower = robot.joints[j].lower;
    joints_[j].upper = robot.joints[j].upper;
    joints_[j].speed = speeds[static_cast<Eigen::Index>(j)];
  }
}

void JointWatch::sent(const Eigen::VectorXd& targets) {
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    Joint& joint = joints_[k];
    const bool first = std::isnan(joint.target);
    joint.target = targets[static_cast<Eigen::Index>(k)];
    if (first) joint.target_at_rest = joint.target;
  }
}

void JointWatch::sent_none() {
  for (Joint& joint : joints_) joint.target = joint.target_at_rest = kNotSent;
}

void JointWatch::begin(const Eigen::VectorXd& q, const Eigen::VectorXd& v, const Eigen::VectorXd& tau) {
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const auto j = static_cast<Eigen::Index>(k);
    Joint& joint = joints_[k];
    joint.q = joint.seen_q = q[j];
    joint.seen_v = v[j];
    joint.seen_tau = tau[j];
    joint.off = joint.fastest = 0.0;
    joint.still = 0;
    joint.jumped = false;
  }
  any_ = true;
}

// A joint that jumped is back where it could have come from, or goes on being a jump's. Ways and speeds are forgotten
// at one rate: a glitch of the speed that was allowed stays allowed.
void JointWatch::see_motion(double q, double v, double dt, Joint& joint) {
  const bool was_jumped = joint.jumped;
  joint.jumped = !(std::abs(q - joint.q) <= kJump + joint.speed * dt);
  if (!joint.jumped) joint.q = q;
  const double by_speed = 0.5 * dt * std::clamp(v + joint.seen_v, -2.0 * kMostSpeed, 2.0 * kMostSpeed);
  const double way = joint.jumped || was_jumped ? 0.0 : q - joint.seen_q - by_speed;
  const double kept = std::exp(-dt / kForget);
  joint.off = kept * joint.off + way;
  joint.fastest = std::max(kept * joint.fastest, std::min(std::abs(v), kMostSpeed));
}

void JointWatch::see_bits(double q, double v, double tau, Joint& joint) {
  const bool still = q == joint.seen_q && v == joint.seen_v && tau == joint.seen_tau;
  joint.still = still ? joint.still + 1 : 0;
  if (!still) joint.target_at_rest = joint.target;
  joint.seen_q = q;
  joint.seen_v = v;
  joint.seen_tau = tau;
}

void JointWatch::see_range(double q, Joint& joint) {
  std::rotate(joint.excess.begin(), joint.excess.end() - 1, joint.excess.end());
  joint.excess[0] = std::max({joint.lower - q, q - joint.upper, 0.0});
}

void JointWatch::see(const Eigen::VectorXd& q, const Eigen::VectorXd& v, const Eigen::VectorXd& tau, double dt,
                     bool learns) {
  if (!any_ || dt > kNewStart) begin(q, v, tau);
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const auto j = static_cast<Eigen::Index>(k);
    see_motion(q[j], v[j], dt, joints_[k]);
    see_bits(q[j], v[j], tau[j], joints_[k]);
    see_range(q[j], joints_[k]);
  }
  judge(learns);
}

void JointWatch::judge(bool learns) {
  doubts_ = {};
  int jump = -1, frozen = -1, mismatch = -1, outside = -1, still = joints_.front().still;
  for (std::size_t k = joints_.size(); k-- > 0;) {
    const Joint& joint = joints_[k];
    const int j = static_cast<int>(k);
    if (joint.jumped) jump = j;
    if (joint.still >= kStillStates && std::abs(joint.target - joint.target_at_rest) > kTargetMoved) frozen = j;
    const bool is_off = !(std::abs(joint.off) <= kMismatch + kSpeedLag * joint.fastest);
    if (is_off) (joint.still >= kStillStates ? frozen : mismatch) = j;
    const double excess = *std::ranges::min_element(joint.excess);
    if (excess > doubts_.excess) {
      doubts_.excess = excess;
      outside = j;
    }
    still = std::min(still, joint.still);
  }
  if (learns) longest_still_ = std::max(longest_still_, still);
  const bool is_noisy = longest_still_ <= kMostLearnt;
  if (!learns && is_noisy && still >= std::max(kStillStates, kStillShare * longest_still_)) frozen = 0;
  doubts_.jump = jump >= 0;
  doubts_.frozen = frozen >= 0;
  doubts_.mismatch = mismatch >= 0;
  for (const int joint : {outside, mismatch, frozen, jump})
    if (joint >= 0) doubts_.joint = joint;
}

}  // namespace duet
