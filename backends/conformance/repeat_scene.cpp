// Bitwise repetition while a person pushes the standing G1.
#include <algorithm>
#include <array>
#include <thread>

#include "duet/backends/conformance/scenes.h"
#include "duet/backends/conformance/small_robots.h"
#include "duet/backends/conformance/trial.h"
#include "duet/backends/factory.h"
#include "duet/core/skeleton.h"

namespace duet::conformance {
namespace {

constexpr double kBefore = 0.3, kAfter = 0.3;  // of the snapshot [s]

Scene pushed_scene(const Trial& trial) {
  Scene scene = trial.scene(trial.robot(), trial.dt());
  scene.partner = PartnerMode::kSolid;
  scene.self_collision = true;
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
  bool touched = false;
  for (const Contact& contact : backend->contacts())
    touched = touched || (contact.side == ContactSide::kHuman && contact.f_W.norm() > 0.0);
  trial.absolute("person touches at the snapshot", "", trial.dt(), touched ? 1.0 : 0.0, 1.0, 0.0,
                 "so that the continuation is one in contact");
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
