// The robot on its feet: weight, fall, and a person who pushes and holds.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <thread>

#include "duet/backends/conformance/reference.h"
#include "duet/backends/conformance/trial.h"
#include "duet/backends/engine_module.h"
#include "duet/core/recording.h"
#include "duet/robots/roles.h"

namespace duet::conformance {
namespace {

constexpr double kDrop = 1e-3;  // of the soles over the ground at the start [m]

// A world with a robot that stands under ankle feedback, refreshed at 100 Hz.
class Standing {
 public:
  Standing(const Trial& trial, const Scene& scene)
      : world_(trial, scene), balance_(world_.robot()), every_(std::max(1, steps_in(AnkleBalance::kPeriod, scene.dt))) {
    RobotState start = world_.robot().standing_state();
    start.X_WB.p.z() += kDrop;
    world_.reset(start);
  }

  World& world() { return world_; }
  void step() {
    if (steps_++ % every_ == 0) command_ = balance_.command(world_.state(), world_.robot().neutral);
    world_.step(command_);
  }
  void run(double seconds) {
    for (int i = 0; i < steps_in(seconds, world_.dt()); ++i) step();
  }
  [[nodiscard]] Eigen::Vector3d feet() const {
    Kinematics kinematics(world_.robot());
    kinematics.update(world_.state().X_WB, world_.state().q);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const int foot : world_.robot().feet) sum += kinematics.shape_position(foot);
    return sum / static_cast<double>(world_.robot().feet.size());
  }

 private:
  World world_;
  AnkleBalance balance_;
  JointCommand command_;
  int every_;
  long steps_ = 0;
};

}  // namespace

std::string lacks_soles(const RobotModel& robot) {
  return robot.feet.empty() ? fmt::format("the card of robot '{}' has no soles", robot.name) : "";
}

std::string lacks_ankles(const RobotModel& robot) {
  for (const std::vector<int>& leg : robot.roles.legs) {
    if (leg.size() < 2) return fmt::format("the card of robot '{}' has no 'legs' of two or more joints", robot.name);
    const int inner = leg[leg.size() - 2], outer = leg.back();
    if (is_roll(robot, inner) == is_roll(robot, outer))
      return fmt::format("a leg of robot '{}' ends in '{}' and '{}', expected an ankle's pitch and roll", robot.name,
                         robot.joints[inner].name, robot.joints[outer].name);
  }
  return lacks_soles(robot);
}

std::string lacks_trunk_or_ankles(const RobotModel& robot) {
  const auto is_trunk = [](const RobotShape& shape) { return shape.region == "torso"; };
  if (std::ranges::none_of(robot.shapes, is_trunk))
    return fmt::format("the card of robot '{}' has no shape of the region 'torso'", robot.name);
  return lacks_ankles(robot);
}

void measure_stand(Trial& trial) {
  const double seconds = trial.full() ? 10.0 : 3.0, watch = trial.full() ? 2.0 : 0.5;
  const std::vector<double> sizes = trial.full() ? trial.step_sizes() : std::vector{trial.dt()};
  for (const double dt : sizes) {
    Standing standing(trial, trial.scene(trial.robot(), dt));
    World& world = standing.world();
    const double weight = world.robot().total_mass() * kGravity;
    const Eigen::Vector3d feet = standing.feet();
    standing.run(seconds - watch);
    double force = 0.0, depth = 0.0, speed = 0.0;
    const int steps = steps_in(watch, dt);
    for (int i = 0; i < steps; ++i) {
      standing.step();
      force += world.force_of(ContactSide::kGround).z() / steps;
      speed += world.state().v.squaredNorm() / (world.robot().dof() * steps);
      for (const Contact& contact : world.backend().contacts()) depth = std::max(depth, contact.depth);
    }
    trial.relative("ground force", "N", dt, force, weight, 1e-3, "m g, mean over the last part");
    trial.at_most("deepest sole", "m", dt, depth, 1e-3, "over the last part");
    trial.at_most("drift of the feet", "m", dt, (standing.feet() - feet).head<2>().norm(), 5e-3,
                  "from the start, 1 mm drop included");
    trial.at_most_found("joint speed, rms", "rad/s", dt, std::sqrt(speed), 1e-3, "over the last part: no buzz");
    trial.at_most("fallen", "", dt, has_fallen(world.state(), world.robot().fall) ? 1.0 : 0.0, 0.0, "at the end");
    trial.dot("error of the ground force, relative", "", dt, std::abs(force / weight - 1.0), world.cost());
  }
}

void measure_fall(Trial& trial) {
  // From MuJoCo 2.2.2 at 2 ms; Bullet, DART and ODE fall at the same step. The median replaces it where engines run.
  constexpr double kStored = 1.218;
  const std::vector<double> sizes = trial.full() ? trial.step_sizes() : std::vector{trial.dt()};
  for (const double dt : sizes) {
    World world(trial, trial.scene(trial.robot(), dt));
    RobotState start = world.robot().standing_state();
    start.X_WB.p.z() += kDrop;
    world.reset(start);
    const JointCommand command = world.robot().default_command(world.robot().neutral);
    while (world.time() < 5.0 && !has_fallen(world.state(), world.robot().fall)) world.step(command);
    trial
        .absolute("time until fallen", "s", dt, world.time(), trial.stored(kStored, world.time()), 0.03,
                  "stored figure of MuJoCo at 2 ms: the card's fall")
        .across_engines = true;
  }
}

namespace {

constexpr double kPressSpeed = 0.2, kPressGap = 0.01, kPressDepth = 0.03;  // [m/s], [m]
constexpr double kPressStart = 1.5, kPress = 3.0;                          // [s]
constexpr double kHandRadius = 0.05, kPressHeight = 0.17;  // over the origin of the card's push_link [m]

HumanBody one_chest() {
  HumanCapsule capsule;
  capsule.name = "chest";
  capsule.region = "chest";
  capsule.joint_a = kLeftShoulder;
  capsule.joint_b = kRightShoulder;
  capsule.radius = kHandRadius;
  capsule.skin = default_skin("chest");
  return {{capsule}};
}

struct Press {
  double peak = 0.0, held = 0.0, ground = 0.0;  // [N]
  double impulse = 0.0, missing = 0.0;          // of the human, and what the momentum balance lacks [N s]
  double cost = 0.0;
};

// A capsule across the chest comes from the front, goes 3 cm on after the first touch and stays there.
Press press(const Trial& trial, double dt) {
  Scene scene = trial.scene(trial.robot(), dt);
  scene.partner = PartnerMode::kSolid;
  scene.human = one_chest();
  Standing standing(trial, scene);
  World& world = standing.world();
  standing.run(kPressStart);
  Kinematics kinematics(world.robot());
  kinematics.update(world.state().X_WB, world.state().q);
  const int torso = world.robot().frames[world.robot().roles.push_frame].link;
  double front = 0.0;
  const double height = kinematics.p_WL(torso).z() + kPressHeight;
  for (const RobotShape& shape : world.robot().shapes)
    if (shape.region == "torso")
      front = std::max(front, (kinematics.X_WL(shape.link) * shape.X_LS.p).x() + shape.radius);
  HumanJoints joints = HumanJoints::Zero(), moving = HumanJoints::Zero();
  joints.colwise() = Eigen::Vector3d(front + kHandRadius + kPressGap, 0.0, height);
  joints(1, kLeftShoulder) = 0.3;
  joints(1, kRightShoulder) = -0.3;
  moving.row(0).setConstant(-kPressSpeed);

  Press found;
  const Momentum before = momentum_of(world.robot(), world.state());
  const double travel = (kPressGap + kPressDepth) / kPressSpeed;
  const int steps = steps_in(kPress, dt), stop = steps_in(travel, dt), watch = steps_in(0.3, dt);
  double all = 0.0;
  world.backend().set_partner(joints, moving);
  for (int i = 0; i < steps; ++i) {
    if (i == stop) {
      joints.row(0).array() -= kPressSpeed * dt * stop;
      world.backend().set_partner(joints, HumanJoints::Zero());
    }
    standing.step();
    const Eigen::Vector3d human = world.force_of(ContactSide::kHuman), ground = world.force_of(ContactSide::kGround);
    found.peak = std::max(found.peak, human.norm());
    found.impulse += dt * human.x();
    all += dt * (human.x() + ground.x());
    if (i < steps - watch) continue;
    found.held += human.x() / watch;
    found.ground += ground.x() / watch;
  }
  found.missing = all - (momentum_of(world.robot(), world.state()).linear - before.linear).x();
  found.cost = world.cost();
  return found;
}

}  // namespace

void measure_held_push(Trial& trial) {
  // From MuJoCo 2.2.2 at 2 ms, as in measure_fall.
  constexpr double kStoredPeak = 96.0, kStoredHeld = -6.17;
  std::vector<double> peaks;
  for (const double dt : trial.step_sizes()) {
    const Press found = press(trial, dt);
    peaks.push_back(found.peak);
    trial.relative("ground force while held", "N", dt, found.ground, -found.held, 0.03,
                   "balances the person's force, mean over the last 0.3 s");
    trial.absolute("momentum that the forces do not explain", "N s", dt, found.missing, 0.0,
                   0.03 * std::abs(found.impulse), "impulse of person and ground less the robot's momentum; 3 %");
    trial
        .relative("peak force", "N", dt, found.peak, trial.stored(kStoredPeak, found.peak), 0.15,
                  "stored figure of MuJoCo")
        .across_engines = true;
    trial
        .relative("held force", "N", dt, found.held, trial.stored(kStoredHeld, found.held), 0.15,
                  "stored figure of MuJoCo")
        .across_engines = true;
    trial.dot("momentum that the forces do not explain", "N s", dt, std::abs(found.missing), found.cost);
  }
  for (std::size_t i = 1; i < peaks.size(); ++i)
    trial.relative("peak force over that at twice the step", "", trial.step_sizes()[i], peaks[i] / peaks[i - 1], 1.0,
                   0.15, "the skin makes the peak a property of the bodies");
}

// Bitwise repetition while a person pushes the standing G1; without the person where the engine has no solid partner.

namespace {

constexpr double kBefore = 0.3, kAfter = 0.3;  // of the snapshot [s]

Scene pushed_scene(const Trial& trial) {
  Scene scene = trial.scene(trial.robot(), trial.dt());
  scene.self_collision = true;
  if (!trial.no_partner().empty()) return scene;
  scene.partner = PartnerMode::kSolid;
  HumanCapsule capsule;
  capsule.name = "chest";
  capsule.region = "chest";
  capsule.joint_a = kLeftShoulder;
  capsule.joint_b = kRightShoulder;
  capsule.radius = 0.05;
  capsule.skin = default_skin("chest");
  scene.human.capsules = {capsule};
  return scene;
}

// The capsule reaches the chest after a quarter of a second; a side push is on from the start.
void start(Backend& backend) {
  const RobotModel& robot = *backend.scene().robot;
  const RobotState state = robot.standing_state();
  backend.reset(state);
  HumanJoints joints = HumanJoints::Zero(), velocities = HumanJoints::Zero();
  joints.colwise() = state.X_WB.p + Eigen::Vector3d(0.187, 0.0, 0.25);
  joints(1, kLeftShoulder) = 0.3;
  joints(1, kRightShoulder) = -0.3;
  velocities.row(0).setConstant(-0.2);
  backend.set_partner(joints, velocities);
  backend.push(0, {0.0, 5.0, 0.0}, state.X_WB.p);
}

// All that a run shows, as numbers.
using Trace = std::vector<double>;

Trace run(Backend& backend, double seconds) {
  const RobotModel& robot = *backend.scene().robot;
  const JointCommand command = robot.default_command(robot.neutral);
  Trace trace;
  const auto add = [&trace](const auto& vector) {
    trace.insert(trace.end(), vector.data(), vector.data() + vector.size());
  };
  for (int i = 0; i < steps_in(seconds, backend.scene().dt); ++i) {
    if (backend.step(command) != Outcome::kOk) throw std::runtime_error("diverged");
    const RobotState& state = backend.state();
    add(state.X_WB.p);
    add(state.X_WB.R.coeffs());
    add(state.v_WB);
    add(state.w_WB_B);
    add(state.q);
    add(state.v);
    for (const Contact& contact : backend.contacts()) add(contact.f_W);
  }
  return trace;
}

double differences(const Trace& a, const Trace& b) {
  double count = std::abs(static_cast<double>(a.size()) - static_cast<double>(b.size()));
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) count += a[i] == b[i] ? 0.0 : 1.0;
  return count;
}

Trace fresh_run(const std::string& engine, const Scene& scene) {
  const auto backend = make_backend(engine, scene);
  start(*backend);
  return run(*backend, kBefore + kAfter);
}

// Whether the continuation is one in contact with the person.
void note_touch(Trial& trial, const Backend& backend) {
  constexpr const char* kQuantity = "person touches at the snapshot";
  if (!trial.no_partner().empty()) return trial.unsupported(kQuantity, trial.no_partner());
  const bool touched = std::ranges::any_of(backend.contacts(), [](const Contact& contact) {
    return contact.side == ContactSide::kHuman && contact.f_W.norm() > 0.0;
  });
  trial.absolute(kQuantity, "", trial.dt(), touched ? 1.0 : 0.0, 1.0, 0.0,
                 "so that the continuation is one in contact");
}

Trace joined(Trace first, const Trace& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

}  // namespace

void measure_repeat(Trial& trial) {
  const Scene scene = pushed_scene(trial);
  const auto expect_none = [&](const char* quantity, const Trace& a, const Trace& b, const char* note) {
    trial.at_most(quantity, "numbers", trial.dt(), differences(a, b), 0.0, note);
  };
  const auto backend = make_backend(trial.engine(), scene);
  start(*backend);
  const Trace before = run(*backend, kBefore);
  note_touch(trial, *backend);
  const Snapshot snapshot = backend->snapshot();
  const Trace after = run(*backend, kAfter), whole = joined(before, after);

  backend->restore(snapshot);
  expect_none("differ after a snapshot in contact", run(*backend, kAfter), after, "same world, 0.3 s");
  const auto other = make_backend(trial.engine(), scene);
  start(*other);
  other->restore(snapshot);
  expect_none("differ after a snapshot in a fresh world", run(*other, kAfter), after, "another world, 0.3 s");
  start(*backend);
  expect_none("differ after reset", run(*backend, kBefore + kAfter), whole, "same world, after other runs");
  expect_none("differ in a fresh world", fresh_run(trial.engine(), scene), whole, "0.6 s");

  std::array<Trace, 2> traces;
  std::array<std::string, 2> faults;
  {
    std::array<std::jthread, 2> threads;
    for (std::size_t i = 0; i < 2; ++i)
      threads[i] = std::jthread([&, i] {
        try {
          traces[i] = fresh_run(trial.engine(), scene);
        } catch (const std::exception& error) {
          faults[i] = error.what();
        }
      });
  }
  for (std::size_t i = 0; i < 2; ++i)
    expect_none("differ in two threads at once", traces[i], whole,
                faults[i].empty() ? "each a fresh world" : faults[i].c_str());
}

}  // namespace duet::conformance
