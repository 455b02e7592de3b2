// A start with bodies inside one another is refused by name, in every engine through Backend's own calls.
#include <gmock/gmock.h>

#include "duet/backends/engine_module.h"
#include "duet/backends/narrow_phase.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

// The wheel with a sphere of 0.1 m on its base and one on its rim, the rim's `apart` m to the side.
Scene two_spheres(double apart) {
  auto robot = test::wheel();
  for (const int link : {0, 1}) {
    RobotShape shape;
    shape.link = link;
    shape.X_LS.p.x() = link * apart;
    shape.radius = 0.1;
    shape.region = "ball";
    robot->shapes.push_back(shape);
  }
  robot->self_collision = {{0, 1}};
  Scene scene;
  scene.robot = robot;
  scene.human.capsules = {{.name = "left_hand", .region = "hand", .joint_a = 20, .joint_b = 22, .radius = 0.08}};
  scene.partner = PartnerMode::kSolid;
  return scene;
}

RobotState at_height(const Scene& scene, double z) { return test::state_of(*scene.robot, {0.0, 0.0, z}); }

std::string robot_message(const Scene& scene, double z) {
  return thrown_message<std::invalid_argument>([&] { refuse_robot_overlap(scene, at_height(scene, z)); });
}

HumanJoints hand_at(const Eigen::Vector3d& p_W) {
  HumanJoints joints = HumanJoints::Zero();
  joints.colwise() += p_W;
  return joints;
}

TEST(StartOverlap, NamesTheLinksOfAPairAndTheDepth) {
  EXPECT_EQ(robot_message(two_spheres(0.15), 1.0), "Backend::reset: base and rim overlap by 0.050 m");
  EXPECT_NO_THROW(refuse_robot_overlap(two_spheres(0.171), at_height(two_spheres(0.171), 1.0)));
  Scene untouched = two_spheres(0.15);
  untouched.self_collision = false;
  EXPECT_NO_THROW(refuse_robot_overlap(untouched, at_height(untouched, 1.0)));
}

TEST(StartOverlap, NamesTheLinkBelowTheGroundAndItsDepth) {
  EXPECT_EQ(robot_message(two_spheres(0.3), 0.06), "Backend::reset: base is 0.040 m below the ground");
  EXPECT_NO_THROW(refuse_robot_overlap(two_spheres(0.3), at_height(two_spheres(0.3), 0.071)));
}

TEST(StartOverlap, NamesThePartOfThePartnerAndTheLink) {
  const Scene scene = two_spheres(0.3);
  const RobotState state = at_height(scene, 1.0);
  const auto message = [&](double x) {
    return thrown_message<std::invalid_argument>([&] { refuse_partner_overlap(scene, state, hand_at({x, 0.0, 1.0})); });
  };
  EXPECT_EQ(message(0.36), "Backend::set_partner: left_hand (region hand) of the partner and rim overlap by 0.120 m");
  EXPECT_NO_THROW(refuse_partner_overlap(scene, state, hand_at({0.39, 0.0, 1.0})));
  Scene ghost = scene;
  ghost.partner = PartnerMode::kGhost;
  EXPECT_NO_THROW(refuse_partner_overlap(ghost, state, hand_at({0.3, 0.0, 1.0})));
}

TEST(StartOverlap, EveryEngineRefusesItAndGoesOnAfterAGoodStart) {
  for (const EngineInfo& engine : engines()) {
    if (!engine.available) continue;
    const Scene scene = two_spheres(0.3);
    const auto backend = make_backend(engine.name, scene);
    EXPECT_THROW(backend->reset(at_height(scene, 0.0)), std::invalid_argument) << engine.name;
    backend->reset(at_height(scene, 1.0));
    EXPECT_THROW(backend->set_partner(hand_at({0.3, 0.0, 1.0}), HumanJoints::Zero()), std::invalid_argument)
        << engine.name;
    backend->set_partner(hand_at({0.5, 0.0, 1.0}), HumanJoints::Zero());
    // The partner may move in later: only the start is checked.
    backend->set_partner(hand_at({0.36, 0.0, 1.0}), HumanJoints::Zero());
    EXPECT_EQ(backend->step(test::no_torque(*scene.robot)), Outcome::kOk) << engine.name;
  }
}

}  // namespace
}  // namespace duet
