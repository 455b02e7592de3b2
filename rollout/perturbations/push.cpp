#include "duet/rollout/perturbations/push.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/clock.h"
#include "duet/core/random.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

// A force at a link's centre of mass, level, in a direction drawn for each push. The first begins after every / 2.
struct Push final : RobotPerturbation {
  double force = 60.0;    // [N]
  double duration = 1.0;  // [s]
  double every = 4.0;     // from begin to begin [s]
  std::string link;       // "": the card's push_link

  [[nodiscard]] std::shared_ptr<const RobotPerturbation> with_links(const RobotModel& robot) const override {
    auto bound = std::make_shared<Push>(*this);
    bound->link = named_link(link, robot);
    return bound;
  }
  void check(const RobotModel& robot) const override { static_cast<void>(perturbed_link(link, robot)); }
  [[nodiscard]] std::unique_ptr<RobotAct> begin(const RobotModel& robot, std::uint64_t seed) const override;
};

class Pushes final : public RobotAct {
 public:
  Pushes(const Push& plan, const RobotModel& robot, std::uint64_t seed)
      : force_(plan.force),
        robot_(robot),
        direction_(seed, stream_key({"perturbation", "push"})),
        kinematics_(robot),
        link_(perturbed_link(plan.link, robot)),
        push_ticks_(std::max(1, ticks_of(plan.duration))),
        every_ticks_(std::max(1, ticks_of(plan.every))) {}

  void act(int tick, Backend& backend) override {
    const int phase = (tick + every_ticks_ - every_ticks_ / 2) % every_ticks_;
    const bool begins = tick >= every_ticks_ / 2 && phase == 0;
    if (!begins && !(pushing_ && phase == push_ticks_)) return;
    const RobotState& state = backend.state();
    kinematics_.update(state.X_WB, state.q);
    const Eigen::Vector3d p_W = kinematics_.p_WL(link_) + kinematics_.R_WL(link_) * robot_.links[link_].com;
    const double angle = begins ? 2.0 * std::numbers::pi * direction_.uniform() : 0.0;
    const double force = begins ? force_ : 0.0;
    backend.push(link_, force * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0), p_W);
    pushing_ = begins;
  }

 private:
  double force_;
  const RobotModel& robot_;
  Random direction_;
  Kinematics kinematics_;
  int link_;
  int push_ticks_, every_ticks_;
  bool pushing_ = false;
};

std::unique_ptr<RobotAct> Push::begin(const RobotModel& robot, std::uint64_t seed) const {
  return std::make_unique<Pushes>(*this, robot, seed);
}

FieldTable<Push> push_table() {
  return {
      field<Push>({.name = "force", .meaning = "at the centre of mass", .unit = "N", .range = {0.0, 5000.0, false}},
                  &Push::force),
      field<Push>({.name = "duration", .meaning = "of each push", .unit = "s", .range = {0.02, 60.0}}, &Push::duration),
      field<Push>({.name = "every",
                   .meaning = "from begin to begin, not below `duration`; the first begins after half of it",
                   .unit = "s",
                   .range = {0.02, 600.0}},
                  &Push::every, &Push::duration),
      field<Push>({.name = "link", .meaning = "a link; where there is none the card's push_link"}, &Push::link)};
}

}  // namespace

PerturbationKind push_kind() {
  return robot_kind<Push>("push", "a level force at a link, from time to time, each in a direction drawn for it",
                          push_table());
}

}  // namespace duet
