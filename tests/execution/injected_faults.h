// Faults that tests put into one engine or into a policy, to see whether `duet blame` names the right one.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/backends/engine_module.h"
#include "duet/execution/blame.h"
#include "tests/execution/staged.h"

namespace duet::test {

enum class Fault { kNone, kFriction, kContacts, kDamping, kShiftedPlan, kFrozenHand, kWrongSign };

struct NamedFault {
  Fault fault;
  const char* name;
  Culprit culprit;
};
inline constexpr std::array<NamedFault, 7> kFaults = {{{Fault::kNone, "clean", Culprit::kNobody},
                                                       {Fault::kFriction, "friction x 0.3", Culprit::kSolver},
                                                       {Fault::kContacts, "contacts dropped", Culprit::kSolver},
                                                       {Fault::kDamping, "joint damping", Culprit::kSolver},
                                                       {Fault::kShiftedPlan, "shifted plan", Culprit::kPolicy},
                                                       {Fault::kFrozenHand, "frozen hand", Culprit::kPolicy},
                                                       {Fault::kWrongSign, "wrong sign", Culprit::kPolicy}}};

// An engine with a fault of its solver: another one behind it has other friction, misses the contacts of the toes or
// drives joints that are damped.
class FaultySolver final : public Backend {
 public:
  FaultySolver(const std::string& engine, const Scene& scene, Fault fault)
      : Backend(scene), fault_(fault), inner_(make_backend(engine, faulty(scene, fault))), command_() {}
  [[nodiscard]] std::string_view name() const override { return inner_->name(); }
  [[nodiscard]] std::string version() const override { return inner_->version(); }

 private:
  static Scene faulty(Scene scene, Fault fault) {
    if (fault == Fault::kFriction) scene.friction.robot_ground *= 0.3;
    if (fault == Fault::kContacts) {
      auto robot = std::make_shared<RobotModel>(*scene.robot);
      for (const int foot : robot->feet) {
        Pose& at = robot->shapes[static_cast<std::size_t>(foot)].X_LS;
        if (at.p.x() > 0.0 && foot < robot->feet[4]) at.p.z() += 0.2;  // the left foot's toes never touch
      }
      scene.robot = robot;
    }
    return scene;
  }
  void take() {
    state_ = inner_->state();
    contacts_.assign(inner_->contacts().begin(), inner_->contacts().end());
    torques_ = inner_->torques();
  }
  void do_reset() override {
    inner_->reset(state_);
    take();
  }
  void do_set_partner(const HumanJoints& joints, const HumanJoints& velocities) override {
    inner_->set_partner(joints, velocities);
  }
  Outcome do_step(const JointCommand& command) override {
    command_ = command;
    if (fault_ == Fault::kDamping) command_.kd.array() += 30.0;  // [N m s / rad]
    const Outcome outcome = inner_->step(command_);
    take();
    return outcome;
  }
  void do_push(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_W) override {
    inner_->push(link, f_W, p_W);
  }
  void do_kick(const Eigen::Vector3d& dv_W) override { inner_->kick(dv_W); }
  void do_snapshot(Snapshot& snapshot) const override {
    const Snapshot inner = inner_->snapshot();
    snapshot.values.insert(snapshot.values.end(), inner.values.begin(), inner.values.end());
  }
  void do_restore(std::span<const double> values) override { inner_->restore({{values.begin(), values.end()}}); }

  Fault fault_;
  std::unique_ptr<Backend> inner_;
  JointCommand command_;
};

// A policy whose plan lies half a metre aside, holds the arms as they were at first, or moves them the wrong way.
class FaultyPolicy final : public Policy {
 public:
  FaultyPolicy(std::unique_ptr<Policy> policy, std::vector<int> arms, Fault fault)
      : policy_(std::move(policy)), arms_(std::move(arms)), fault_(fault) {}
  [[nodiscard]] std::string_view name() const override { return policy_->name(); }
  void reset(const EpisodeContext& context) override {
    start_ = context.start.q;
    policy_->reset(context);
  }
  Anchors act(const Observation& observation) override { return policy_->act(observation); }
  std::vector<Reference> plan(const Observation& observation) override {
    std::vector<Reference> plan = policy_->plan(observation);
    for (Reference& reference : plan) {
      if (fault_ == Fault::kShiftedPlan) reference.X_WB.p += reference.X_WB.R * Eigen::Vector3d(0.0, 0.5, 0.0);
      for (const int joint : arms_) {
        if (fault_ == Fault::kFrozenHand) reference.q[joint] = start_[joint];
        if (fault_ == Fault::kWrongSign) reference.q[joint] = 2.0 * start_[joint] - reference.q[joint];
      }
    }
    return plan;
  }
  [[nodiscard]] PolicyFaults faults() const override { return policy_->faults(); }

 private:
  std::unique_ptr<Policy> policy_;
  std::vector<int> arms_;
  Fault fault_;
  Eigen::VectorXd start_;
};

inline bool is_of_solver(Fault fault) {
  return fault == Fault::kFriction || fault == Fault::kContacts || fault == Fault::kDamping;
}

// The episode with the fault in its engine or its policy.
inline BlameOptions with_fault(BlameOptions options, Fault fault, const EpisodeSpec& spec) {
  if (is_of_solver(fault)) {
    options.make_engine = [fault, own = spec.engine](const std::string& engine,
                                                     const Scene& scene) -> std::unique_ptr<Backend> {
      if (engine == own) return std::make_unique<FaultySolver>(engine, scene, fault);
      return make_backend(engine, scene);
    };
  } else if (fault != Fault::kNone) {
    std::vector<int> arms;
    const std::vector<std::string> joints = spec.body->robot->joint_names();
    for (std::size_t j = 0; j < joints.size(); ++j)
      for (const char* part : {"shoulder", "elbow", "wrist"})
        if (joints[j].find(part) != std::string::npos) arms.push_back(static_cast<int>(j));
    options.policy = [fault, arms, make = spec.leader->make] {
      return std::make_unique<FaultyPolicy>(make(), arms, fault);
    };
  }
  return options;
}

// Acts that need the place and the hand, under a controller that walks up on a floor of little friction.
inline std::string fault_suite(int per_task, const std::string& engine) {
  return "schema: duet.suite/1\nname: faults\nversion: 1.0.0\nclips: {synth: {per_task: " + std::to_string(per_task) +
         ", seed: 4711}}\ntasks: [handshake, high_five]\nengines: [" + engine +
         "]\ncontrollers: [wbc_sim]\npolicies: [replay]\nnull_arm: false\nperturbations: [{name: floor, friction: "
         "0.4}]\n";
}

}  // namespace duet::test
