#include "duet/rollout/perturbations/perturbation_kind.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/robots/kinematics.h"

namespace duet {

PerturbationKind valued_kind(const std::string& name, std::string meaning, const Field<Perturbation>& value,
                             const std::string& fallback) {
  const auto read = [=](const SchemaSection& item, Perturbation& into) {
    const YamlSection mapping(item.file, item.node(name.c_str()), name, {value.name.c_str()});
    set_field(value, into, fallback);
    read_field(mapping, value, into);
  };
  const auto write = [value](const Perturbation& of) {
    const std::string text = value.text(of);
    return text == value.text(Perturbation()) ? "" : '{' + value.name + ": " + text + '}';
  };
  PerturbationKind kind(name, std::move(meaning), read, {{value.name, value.values, fallback, value.meaning}}, write);
  kind.values = [value](const Perturbation& of) { return FieldTexts{{value.name, value.text(of)}}; };
  return kind;
}

PerturbationKind plain_kind(const Field<Perturbation>& value, const std::string& fallback) {
  PerturbationKind kind(value.name, value.meaning, field_key(value).read, {{"", value.values, fallback, ""}},
                        value.text);
  kind.fallback = fallback;
  return kind;
}

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

namespace {

// A mass at the link's centre of mass; the controller keeps the nominal model.
struct Mass final : RobotPerturbation {
  std::string link;  // as perturbed_link reads it
  double add = 3.0;  // [kg]; below 0: taken away

  [[nodiscard]] std::shared_ptr<const RobotPerturbation> with_links(const RobotModel& robot) const override {
    auto bound = std::make_shared<Mass>(*this);
    bound->link = named_link(link, robot);
    return bound;
  }
  void check(const RobotModel& robot) const override {
    static_cast<void>(changed(std::make_shared<const RobotModel>(robot)));
  }
  [[nodiscard]] std::shared_ptr<const RobotModel> changed(std::shared_ptr<const RobotModel> robot) const override {
    auto heavier = std::make_shared<RobotModel>(*robot);
    RobotLink& loaded = heavier->links[perturbed_link(link, *robot)];
    require(loaded.mass + add > 0.0, "link '{}' has {:.3f} kg: expected some to be left, found {:g} kg added",
            loaded.name, loaded.mass, add);
    loaded.mass += add;
    return heavier;
  }
};

FieldTable<Mass> mass_table() {
  return {field<Mass>(
              {.name = "link", .meaning = "a link or a track of the card (`rhand`); where there is none its push_link"},
              &Mass::link),
          field<Mass>({.name = "add",
                       .meaning = "at the link's centre of mass; below 0 it is taken away",
                       .unit = "kg",
                       .range = {-100.0, 100.0}},
                      &Mass::add)};
}

}  // namespace

PerturbationKind mass_kind() {
  return robot_kind<Mass>("mass", "a link has more mass than the controller knows", mass_table());
}

namespace {

// Standard deviations of what the controller sees, drawn anew every tick.
struct Noise final : RobotPerturbation {
  Noise() = default;
  Noise(double of_q, double of_v, double of_w, double of_gravity) : q(of_q), v(of_v), w(of_w), gravity(of_gravity) {}

  double q = 0.01;        // [rad]
  double v = 0.5;         // [rad/s]
  double w = 0.2;         // of the base, each axis of B [rad/s]
  double gravity = 0.05;  // turn of the base about its x and y, which is what gravity in B shows of it [rad]

  [[nodiscard]] std::unique_ptr<RobotAct> begin(const RobotModel& robot, std::uint64_t seed) const override;
};

class NoisyView final : public RobotAct {
 public:
  NoisyView(const Noise& deviation, std::uint64_t seed)
      : deviation_(deviation), random_(seed, stream_key({"perturbation", "noise"})) {}

  [[nodiscard]] bool changes_the_view() const override { return true; }
  void see(RobotState& state) override {
    for (double& q : state.q) q += deviation_.q * random_.normal();
    for (double& v : state.v) v += deviation_.v * random_.normal();
    for (double& w : state.w_WB_B) w += deviation_.w * random_.normal();
    const double x = deviation_.gravity * random_.normal(), y = deviation_.gravity * random_.normal();
    const double angle = std::hypot(x, y);
    if (angle > 0.0) state.X_WB.R *= Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d(x, y, 0.0) / angle));
  }

 private:
  Noise deviation_;
  Random random_;
};

std::unique_ptr<RobotAct> Noise::begin(const RobotModel&, std::uint64_t seed) const {
  return std::make_unique<NoisyView>(*this, seed);
}

FieldTable<Noise> noise_table() {
  constexpr FieldRange kDeviation = {0.0, 100.0};
  return {
      field<Noise>({.name = "q", .meaning = "of joint angles", .unit = "rad", .range = kDeviation}, &Noise::q),
      field<Noise>({.name = "v", .meaning = "of joint velocities", .unit = "rad/s", .range = kDeviation}, &Noise::v),
      field<Noise>({.name = "w", .meaning = "of the base's angular velocity", .unit = "rad/s", .range = kDeviation},
                   &Noise::w),
      field<Noise>({.name = "gravity", .meaning = "of the base's tilt", .unit = "rad", .range = kDeviation},
                   &Noise::gravity)};
}

}  // namespace

PerturbationKind noise_kind() {
  return robot_kind<Noise>("noise",
                           "what the controller measures is noisy: standard deviations, drawn every tick; what a "
                           "mapping does not name has none",
                           noise_table(), {0.0, 0.0, 0.0, 0.0});
}

namespace {

// A force at a link's centre of mass, level, in a direction drawn for each push. The first begins after every / 2.
struct Push final : RobotPerturbation {
  double force = 60.0;    // [N]
  double duration = 1.0;  // [s]
  double every = 4.0;     // from begin to begin [s]
  std::string link;       // as perturbed_link reads it

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
      field<Push>(
          {.name = "link", .meaning = "a link or a track of the card (`rhand`); where there is none its push_link"},
          &Push::link)};
}

}  // namespace

PerturbationKind push_kind() {
  return robot_kind<Push>("push", "a level force at a link, from time to time, each in a direction drawn for it",
                          push_table());
}

}  // namespace duet
