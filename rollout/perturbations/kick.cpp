#include "duet/rollout/perturbations/kick.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/clock.h"
#include "duet/core/random.h"

namespace duet {
namespace {

// Changes of the velocity of the whole robot (Backend::kick), level, each in a direction drawn for it: the first at
// `first`, then one in every `from` to `to`, drawn.
struct Kick final : RobotPerturbation {
  double speed = 0.5;           // [m/s]
  double first = 2.0;           // [s]
  double from = 3.0, to = 6.0;  // [s]

  [[nodiscard]] std::unique_ptr<RobotAct> begin(const RobotModel& robot, std::uint64_t seed) const override;
};

class Kicks final : public RobotAct {
 public:
  Kicks(const Kick& plan, std::uint64_t seed)
      : plan_(plan), random_(seed, stream_key({"perturbation", "kick"})), next_(ticks_of(plan.first)) {}

  void act(int tick, Backend& backend) override {
    if (tick < next_) return;
    const double angle = 2.0 * std::numbers::pi * random_.uniform();
    backend.kick(plan_.speed * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0));
    next_ = tick + std::max(1, ticks_of(random_.uniform(plan_.from, plan_.to)));
  }

 private:
  Kick plan_;
  Random random_;
  int next_;  // tick
};

std::unique_ptr<RobotAct> Kick::begin(const RobotModel&, std::uint64_t seed) const {
  return std::make_unique<Kicks>(*this, seed);
}

FieldTable<Kick> kick_table() {
  return {
      field<Kick>({.name = "speed", .meaning = "the change", .unit = "m/s", .range = {0.0, 20.0, false}}, &Kick::speed),
      field<Kick>({.name = "first", .meaning = "when the first one comes", .unit = "s", .range = kEpisodeTime},
                  &Kick::first),
      field<Kick>({.name = "from", .meaning = "shortest time to the next", .unit = "s", .range = {0.02, 600.0}},
                  &Kick::from),
      field<Kick>({.name = "to",
                   .meaning = "longest time to the next, not below `from`; drawn between the two",
                   .unit = "s",
                   .range = {0.02, 600.0}},
                  &Kick::to, &Kick::from)};
}

}  // namespace

PerturbationKind kick_kind() {
  return robot_kind<Kick>(
      "kick", "the whole robot's velocity changes at once, level, from time to time, in a direction drawn for each",
      kick_table());
}

}  // namespace duet
