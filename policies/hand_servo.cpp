#include "duet/policies/hand_servo.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "duet/policies/arm_reach.h"
#include "duet/tasks/task_definition.h"

namespace duet {
namespace {

constexpr int kPlannedApart = 5;   // ticks between the places of a plan that are looked at
constexpr int kReachSteps = 6;     // of the arm, from where the reference has it
constexpr double kRootGain = 0.3;  // of what the arm lacks, a tick [1]
constexpr double kClasp = 0.1;     // hands that have to touch for longer have to stay together [s]

double eased(double from, double to, double value) {
  const double x = std::clamp((value - from) / (to - from), 0.0, 1.0);
  return x * x * (3.0 - 2.0 * x);
}

// The vector, cut to that length.
Eigen::Vector3d within(const Eigen::Vector3d& vector, double length) {
  return vector * (length / std::max(vector.norm(), length));
}

class HandServo final : public Policy {
 public:
  HandServo(std::unique_ptr<Policy> policy, std::shared_ptr<const RobotModel> robot, HandServoReach reach)
      : policy_(std::move(policy)), robot_(std::move(robot)), reach_(reach), arms_(robot_, policy_->name()) {
    joints_ = Eigen::VectorXd::Zero(robot_->dof());
  }

  [[nodiscard]] std::string_view name() const override { return policy_->name(); }

  void reset(const EpisodeContext& context) override {
    policy_->reset(context);
    on_ = is_hand_to_hand(context.task);
    bounds_ = hand_servo_bounds(reach_, context.task);
    partner_.reset();
    planned_.clear();
    meeting_ = {};
    joints_.setZero();
    root_.setZero();
  }

  Anchors act(const Observation& observation) override { return policy_->act(observation); }

  std::vector<Reference> plan(const Observation& observation) override {
    std::vector<Reference> plan = policy_->plan(observation);
    if (on_ && !plan.empty()) remember(observation.tick, plan);
    return plan;
  }

  [[nodiscard]] bool corrects() const override { return on_; }

  // A frame that is not finite shows no hand: the correction is let go of.
  void correct(const Observation& observation, Reference& reference) override {
    Eigen::VectorXd joints = Eigen::VectorXd::Zero(robot_->dof());
    Eigen::Vector3d root = Eigen::Vector3d::Zero();
    if (is_finite(observation)) want(observation, reference, joints, root);
    const double turn = bounds_.joint_rate / kTickRate, way = bounds_.root_rate / kTickRate;
    joints_ += (joints - joints_).cwiseMin(turn).cwiseMax(-turn);
    root_ += within(root - root_, way);
    if (is_at_rest()) return;
    reference.q = (reference.q + joints_).cwiseMax(robot_->lower()).cwiseMin(robot_->upper());
    reference.X_WB.p += root_;
  }

  [[nodiscard]] PolicyFaults faults() const override { return policy_->faults(); }

 private:
  // A hand of the robot and one of the partner, 0 left, 1 right; -1: none.
  struct Meeting {
    int own = -1, theirs = -1;
  };
  // Where a plan has the hands. [m]
  struct PlannedHands {
    int tick;
    std::array<Eigen::Vector3d, 2> hands;
  };

  [[nodiscard]] bool is_at_rest() const { return joints_.isZero(0.0) && root_.isZero(0.0); }
  [[nodiscard]] double held_out(int theirs) const {
    const double raised = eased(bounds_.low, bounds_.high, partner_.rise(theirs));
    return bounds_.all_out > 0.0 ? std::max(raised, eased(bounds_.out, bounds_.all_out, partner_.approach(theirs)))
                                 : raised;
  }
  [[nodiscard]] double nearness(double distance) const { return 1.0 - eased(bounds_.near, bounds_.far, distance); }

  void remember(int tick, const std::vector<Reference>& plan) {
    planned_.clear();
    for (int i = 0; i < static_cast<int>(plan.size()); i += kPlannedApart)
      planned_.push_back({tick + i, {hand(0, plan[i]), hand(1, plan[i])}});
  }

  [[nodiscard]] Eigen::Vector3d hand(int own, const Reference& reference) {
    return reference.X_WB * arms_.hand(own, reference.q);
  }

  // The corrections that are wanted now.
  void want(const Observation& observation, const Reference& reference, Eigen::VectorXd& joints,
            Eigen::Vector3d& root) {
    partner_.look(observation.now());
    if (is_at_rest()) meeting_ = nearest(observation, reference);
    if (meeting_.own < 0) return;
    const double out = held_out(meeting_.theirs);
    if (out <= 0.0) return;
    const RobotState& robot = observation.now().robot;
    const Eigen::Vector3d goal = seen(observation, meeting_.theirs, bounds_.ahead);
    const double arm = out * nearness((hand(meeting_.own, reference) - goal).norm());
    const double step = out * nearness(planned_distance(observation.tick, goal));
    if (arm > 0.0) joints = reached(robot, reference, goal, arm);
    if (step > 0.0) root = stepped(robot, seen(observation, meeting_.theirs, bounds_.root_ahead), step);
  }

  // The two hands that are nearest where the partner's is held out.
  Meeting nearest(const Observation& observation, const Reference& reference) {
    Meeting found;
    double least = std::numeric_limits<double>::infinity();
    for (const int theirs : {0, 1}) {
      if (held_out(theirs) <= 0.0) continue;
      const Eigen::Vector3d goal = seen(observation, theirs, bounds_.ahead);
      for (const int own : {0, 1}) {
        const double distance = (hand(own, reference) - goal).norm();
        if (distance >= least) continue;
        least = distance;
        found = {own, theirs};
      }
    }
    return found;
  }

  // Where the partner's hand will be in so many seconds if it goes on as it was seen to go.
  [[nodiscard]] Eigen::Vector3d seen(const Observation& observation, int theirs, double ahead) const {
    const int joint = theirs == 0 ? kLeftHand : kRightHand, frames = static_cast<int>(observation.history.size());
    Eigen::Vector3d moment = Eigen::Vector3d::Zero();
    double spread = 0.0;
    for (int i = 0; i < frames; ++i) {
      const double t = (i - 0.5 * (frames - 1)) / kTickRate;
      moment += t * observation.history[i].partner.col(joint);
      spread += t * t;
    }
    const Eigen::Vector3d now = observation.now().partner.col(joint);
    return spread > 0.0 ? Eigen::Vector3d(now + ahead * moment / spread) : now;
  }

  // How near the plan brings the hand to the goal from now on, within the horizon.
  [[nodiscard]] double planned_distance(int tick, const Eigen::Vector3d& goal) const {
    double least = std::numeric_limits<double>::infinity();
    for (const PlannedHands& at : planned_)
      if (at.tick >= tick && at.tick <= tick + bounds_.horizon * kTickRate)
        least = std::min(least, (at.hands[meeting_.own] - goal).norm());
    return least;
  }

  // Moves the hand by that share of the way to the goal, over the trunk as it is.
  Eigen::VectorXd reached(const RobotState& robot, const Reference& reference, const Eigen::Vector3d& goal,
                          double share) {
    Eigen::VectorXd before = robot.q;
    for (const int joint : robot_->roles.arms[meeting_.own]) before[joint] = reference.q[joint];
    const Eigen::Vector3d hand = arms_.hand(meeting_.own, before), shoulder = arms_.shoulder(meeting_.own, before);
    const Eigen::Vector3d target =
        shoulder + within(robot.X_WB.inverse() * goal - shoulder, bounds_.stretch * arms_.length(meeting_.own));
    Eigen::VectorXd q = before;
    arms_.reach(meeting_.own, hand + share * (target - hand), kReachSteps, q);
    return q - before;
  }

  // Moves the root towards the goal until a bent arm reaches it.
  Eigen::Vector3d stepped(const RobotState& robot, const Eigen::Vector3d& goal, double share) {
    const Eigen::Vector3d out = goal - robot.X_WB * arms_.shoulder(meeting_.own, robot.q);
    const Eigen::Vector3d towards = Eigen::Vector3d(out.x(), out.y(), 0.0).normalized();
    const double reach = bounds_.bent * arms_.length(meeting_.own);
    const double lacks = out.head<2>().norm() - std::sqrt(std::max(reach * reach - out.z() * out.z(), 0.0));
    return std::clamp(root_.dot(towards) + kRootGain * lacks, 0.0, share * bounds_.root) * towards;
  }

  std::unique_ptr<Policy> policy_;
  std::shared_ptr<const RobotModel> robot_;  // shared with the policy
  HandServoReach reach_;
  HandServoBounds bounds_;  // of the task
  ArmReach arms_;
  HandWatch partner_;
  std::vector<PlannedHands> planned_;  // of the last plan
  Meeting meeting_;                    // that the corrections are for
  Eigen::VectorXd joints_;             // corrections at the last tick [rad]
  Eigen::Vector3d root_ = Eigen::Vector3d::Zero();
  bool on_ = false;
};

}  // namespace

bool is_hand_to_hand(Task task) { return definition_of(task).interaction.touch == Touch::kHands; }

HandServoBounds hand_servo_bounds(HandServoReach reach, Task task) {
  if (reach != HandServoReach::kWide || definition_of(task).interaction.touch_s <= kClasp) return {};
  return {.far = 0.60, .near = 0.40, .out = 0.06, .all_out = 0.15};
}

std::unique_ptr<Policy> with_hand_servo(std::unique_ptr<Policy> policy, std::shared_ptr<const RobotModel> robot,
                                        HandServoReach reach) {
  return std::make_unique<HandServo>(std::move(policy), std::move(robot), reach);
}

}  // namespace duet
