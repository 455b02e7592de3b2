// A perturbation of the robot itself: of what its controller measures of it, of its velocity, of its body. One kind is
// one unit in rollout/kinds, and a row in rollout/perturbations/perturbation_kinds.cpp.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "duet/backends/backend.h"
#include "duet/robots/robot_model.h"

namespace duet {

// One at work in one episode. Allocates nothing; not thread-safe.
class RobotAct {
 public:
  RobotAct() = default;
  RobotAct(const RobotAct&) = delete;
  RobotAct& operator=(const RobotAct&) = delete;
  virtual ~RobotAct() = default;

  [[nodiscard]] virtual bool changes_the_view() const { return false; }
  // Changes the state that the controller sees; called once a tick, if changes_the_view().
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

// The index of the link that a perturbation names; "" names the card's push_link. Throws std::invalid_argument with the
// nearest and all known names.
int perturbed_link(const std::string& name, const RobotModel& robot);

// The name of the card's push_link where `name` is "".
std::string named_link(const std::string& name, const RobotModel& robot);

}  // namespace duet
