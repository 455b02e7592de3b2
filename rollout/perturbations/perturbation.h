// Disturbances of an episode, beside the clean arm: the controller's view of the state, its way to the joints, pushes,
// the ground, the robot's mass, the policy's view of the partner, the way of its plans, the partner itself. A named
// value of a suite; strict YAML (docs/file-formats.md, "Perturbations").
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/core/task.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/yaml_section.h"
#include "duet/rollout/perturbations/partner_perturbation.h"

namespace duet {

// A perturbation of the robot itself: of what its controller measures of it, of its velocity, of its body. One kind is
// one unit in rollout/kinds, and a row in rollout/perturbations/perturbation_kinds.cpp.

// One at work in one episode. Allocates nothing; not thread-safe.
class RobotAct {
 public:
  RobotAct() = default;
  RobotAct(const RobotAct&) = delete;
  RobotAct& operator=(const RobotAct&) = delete;
  virtual ~RobotAct() = default;

  [[nodiscard]] virtual bool changes_the_view() const { return false; }
  // Changes the state that the controller sees; called as often as it acts, if changes_the_view().
  virtual void see(RobotState&) {}
  // Acts on the robot before the physics steps of `tick`.
  virtual void act(int, Backend&) {}
};

// The values of a kind. A constant: episodes share it.
class RobotPerturbation {
 public:
  virtual ~RobotPerturbation() = default;

  // Names the robot's own link where none is named: what a suite's hash is made of. Null where it names no link.
  [[nodiscard]] virtual std::shared_ptr<const RobotPerturbation> with_links(const RobotModel&) const { return nullptr; }
  // Throws std::invalid_argument: a link that the robot lacks (with the nearest and all that it has), values that it
  // cannot have.
  virtual void check(const RobotModel&) const {}
  // The robot that is simulated.
  [[nodiscard]] virtual std::shared_ptr<const RobotModel> changed(std::shared_ptr<const RobotModel> robot) const {
    return robot;
  }
  // The perturbation's effect during an episode; null where it has none. The robot outlives it.
  [[nodiscard]] virtual std::unique_ptr<RobotAct> begin(const RobotModel&, std::uint64_t) const { return nullptr; }
};

// The index of the link that a perturbation names: a link or frame, one of the card's tracks ("rhand"), or with "" its
// push_link. Throws std::invalid_argument with the
// nearest and all known names.
int perturbed_link(const std::string& name, const RobotModel& robot);

// The same as the name of a link or frame; one that is not there stays as it is.
std::string named_link(const std::string& name, const RobotModel& robot);

// Another law, share of the card's armature or physics step than the profile's (backends/actuation.h); what is none is
// the profile's. As it stands: torques set from the state, in an engine that knows no armature, at its users' step.
struct ActuationChange {
  std::optional<TorqueLaw> law = TorqueLaw::kExplicit;
  std::optional<double> armature = 0.0;
  std::optional<double> dt = 0.001;  // [s]
};

inline constexpr const char* kCleanName = "clean";

struct Perturbation {
  std::string name = kCleanName;
  int delay_ticks = 0;             // the controller sees the state of so many ticks ago
  double latency_ms = 0.0;         // from a command to its effect, to the nearest physics step
  std::optional<double> friction;  // of the robot and the ground
  std::optional<ActuationChange> actuation = {};
  std::vector<std::shared_ptr<const RobotPerturbation>> robot = {};  // in the order of the table of kinds
  PerceptionPlan perception;
  double plan_latency_ms = 0.0;  // from what a policy saw to its plan in the scheduler, to the nearest tick
  std::optional<PartnerVariation> partner;
  Tags tags = {};  // that the suite gives it; they change nothing of an episode
};

// How large it is, by what it does. None for the clean arm, for several kinds or values, and where the value is
// not 0 in a clean episode (a friction, a scale).
std::optional<PerturbationSize> size_of(const Perturbation& perturbation);

// The tags that rows hold: its own, its kinds and its size. The clean arm has nothing but its own.
Tags tags_of(const Perturbation& perturbation);

// The kinds that may be named alone, with their defaults: one table (rollout/perturbation_kinds.h).
const std::vector<std::string>& perturbation_kinds();

// Throws std::invalid_argument for another name, with the nearest; "clean" is one.
Perturbation default_perturbation(const std::string& kind);

// The list under `perturbations` of a suite; [clean] where it is absent. Throws InputError: file, line, expected,
// found.
std::vector<Perturbation> read_perturbations(const YamlSection& suite, const std::string& file);

// One item of that list with every value written out, on one line.
std::string to_yaml(const Perturbation& perturbation);

// The perturbation with the names of links where none, or a track, is named: what a suite's hash is made of.
Perturbation with_links(Perturbation perturbation, const RobotModel& robot);

// Throws std::invalid_argument where the robot lacks a link that the perturbation names, or would lose all its mass.
void check_perturbation(const Perturbation& perturbation, const RobotModel& robot);

// The robot that is simulated: with the added mass, or `robot` itself.
std::shared_ptr<const RobotModel> perturbed_robot(const Perturbation& perturbation,
                                                  const std::shared_ptr<const RobotModel>& robot);

// A perturbation at work in one episode: between the engine's state and the controller, between the controller's
// command and the joints, and on the robot. Nothing allocates after construction; not thread-safe.
class Disturbance {
 public:
  // `start` is what the controller sees of the time before the episode, and what the joints hold until the first
  // command arrives. `steps_per_act` physics steps of `dt` [s] lie between two commands, `acts_per_tick` in a tick.
  Disturbance(const Perturbation& perturbation, const RobotModel& robot, const RobotState& start, int steps_per_act,
              int acts_per_tick, double dt, std::uint64_t seed);

  // The controller's view at this act; once per act. `state` itself without delay and where no act changes it.
  const RobotState& seen(const RobotState& state);
  // The command of this act; once per act. Copies.
  void send(const JointCommand& command);
  // The command that is in effect in a physics step since the last one was sent, counted from 0.
  [[nodiscard]] const JointCommand& in_effect(int step) const;
  // Acts on the robot; before the physics steps of `tick`.
  void act(int tick, Backend& backend);

 private:
  std::vector<std::unique_ptr<RobotAct>> acts_;
  bool view_changes_ = false;

  std::vector<RobotState> past_;  // a ring of the states that were seen since delay_ticks ago
  std::size_t newest_ = 0;
  RobotState seen_;

  int steps_per_act_;
  int late_steps_;                      // from a command to its effect
  std::vector<JointCommand> commands_;  // a ring of the latest, newest at latest_
  std::size_t latest_ = 0;
};

}  // namespace duet
