// A ball on the skin of a held human capsule, and on the ground.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/backends/conformance/scenes.h"
#include "duet/backends/conformance/small_robots.h"
#include "duet/backends/conformance/trial.h"
#include "duet/core/skeleton.h"

namespace duet::conformance {
namespace {

constexpr double kMass = 10.0, kRadius = 0.1, kImpactSpeed = 1.0;
constexpr double kCapsuleRadius = 0.05, kGap = 1e-3;
constexpr double kSkinStiffness = 25000.0;
constexpr double kCapsuleHeight = 50.0;  // away from the ground

struct Bounce {
  double speed = 0.0, contact_time = 0.0, peak = 0.0, cost = 0.0;
};

// The linearly implicit step on one unilateral spring and damper, which every engine has to make of a skin:
// f = -K r - (D + dt K) v+, not negative.
Bounce discrete_bounce(const Skin& skin, double dt) {
  Bounce bounce;
  double r = kGap, v = -kImpactSpeed;
  for (int i = 0; i < steps_in(0.2, dt); ++i) {
    if (r < 0.0) {
      const double damping = skin.damping + dt * skin.stiffness;
      const double f = std::max(0.0, -(skin.stiffness * r + damping * v) / (1.0 + dt * damping / kMass));
      v += dt * f / kMass;
      if (f > 0.0) bounce.contact_time += dt;
      bounce.peak = std::max(bounce.peak, f);
    }
    r += dt * v;
  }
  bounce.speed = v;
  return bounce;
}

Bounce bounce_in(const Trial& trial, const Skin& skin, double dt) {
  Scene scene = trial.scene(ball(kMass, kRadius), dt);
  scene.gravity.setZero();
  scene.partner = PartnerMode::kSolid;
  HumanCapsule capsule;
  capsule.name = "held";
  capsule.region = "chest";
  capsule.joint_a = kLeftHip;
  capsule.joint_b = kRightHip;
  capsule.radius = kCapsuleRadius;
  capsule.skin = skin;
  scene.human.capsules = {capsule};
  World world(trial, scene);
  RobotState start = state_at(world.robot(), {0.0, 0.0, kCapsuleHeight});
  start.v_WB.x() = -kImpactSpeed;
  world.reset(start);
  HumanJoints joints = HumanJoints::Zero();
  joints.colwise() = Eigen::Vector3d(-(kRadius + kCapsuleRadius + kGap), 0.0, kCapsuleHeight);
  joints(1, kLeftHip) = 0.5;
  joints(1, kRightHip) = -0.5;
  world.backend().set_partner(joints, HumanJoints::Zero());
  const JointCommand command = no_torque(world.robot());
  Bounce bounce;
  for (int i = 0; i < steps_in(0.2, dt); ++i) {
    world.step(command);
    const double f = world.force_of(ContactSide::kHuman).x();
    if (f > 0.0) bounce.contact_time += dt;
    bounce.peak = std::max(bounce.peak, f);
  }
  bounce.speed = world.state().v_WB.x();
  bounce.cost = world.cost();
  return bounce;
}

// Restitution of a unilateral spring and damper (no pull): Schwager and Poeschel, Granular Matter 9 (2007), eq. 21.
double restitution(const Skin& skin) {
  const double beta = 0.5 * skin.damping / kMass;
  const double omega = std::sqrt(skin.stiffness / kMass - beta * beta);
  return std::exp(-beta / omega * (std::numbers::pi - std::atan2(2.0 * beta * omega, omega * omega - beta * beta)));
}

}  // namespace

void measure_skin_bounce(Trial& trial) {
  const double natural = std::sqrt(kSkinStiffness / kMass);
  for (const double damping : {0.0, 200.0}) {
    const Skin skin{.stiffness = kSkinStiffness, .damping = damping};
    const auto name = [&](const char* what) {
      return fmt::format("{} skin: {}", damping == 0.0 ? "undamped" : "damped", what);
    };
    for (const double dt : trial.step_sizes()) {
      const Bounce found = bounce_in(trial, skin, dt), discrete = discrete_bounce(skin, dt);
      const double implicit = 0.5 * std::numbers::pi * natural * dt;  // what the implicit step damps in half a swing
      trial.relative(name("speed after against the implicit step"), "m/s", dt, found.speed, discrete.speed, 1e-3,
                     "linearly implicit step of the same spring and damper");
      trial.relative(name("peak force against the implicit step"), "N", dt, found.peak, discrete.peak, 1e-3,
                     "the same");
      trial.absolute(name("contact time against the implicit step"), "s", dt, found.contact_time, discrete.contact_time,
                     0.5 * dt, "the same number of steps");
      trial.relative(name("restitution"), "", dt, found.speed / kImpactSpeed, restitution(skin), 1.2 * implicit,
                     "of the spring and damper; the implicit step damps pi omega dt / 2 more");
      if (damping == 0.0) {
        trial.relative(name("peak force"), "N", dt, found.peak, kImpactSpeed * kMass * natural, implicit,
                       "v sqrt(m K)");
        trial.absolute(name("contact time"), "s", dt, found.contact_time, std::numbers::pi / natural, 2.0 * dt,
                       "pi sqrt(m / K), counted in steps");
        trial.dot("error of the restitution on an undamped skin", "", dt, std::abs(found.speed / kImpactSpeed - 1.0),
                  found.cost);
      }
    }
  }
}

void measure_ground_bounce(Trial& trial) {
  const double drop = 0.2;
  for (const double dt : trial.step_sizes()) {
    World world(trial, trial.scene(ball(1.0, kRadius), dt));
    const JointCommand command = no_torque(world.robot());
    world.reset(state_at(world.robot(), {0.0, 0.0, kRadius + drop}));
    double highest = 0.0, deepest = 0.0;
    bool touched = false;
    for (int i = 0; i < steps_in(0.8, dt); ++i) {
      world.step(command);
      touched = touched || world.force_of(ContactSide::kGround).z() > 0.0;
      if (touched && world.state().v_WB.z() > 0.0) highest = std::max(highest, world.state().X_WB.p.z() - kRadius);
    }
    for (const Contact& contact : world.backend().contacts()) deepest = std::max(deepest, contact.depth);
    trial.at_most("energy given back", "", dt, highest / drop, 0.01, "height after the impact over 0.2 m");
    trial.at_most("depth at rest", "m", dt, deepest, 1e-3, "0.6 s after the impact");
    trial.relative("force at rest", "N", dt, world.force_of(ContactSide::kGround).z(), kGravity, 1e-3, "m g");
  }
}

}  // namespace duet::conformance
