// Promises of Backend itself for every engine: arguments are checked once, with messages that name the joint.
#include "duet/backends/backend.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <functional>
#include <limits>

#include "duet/backends/actuation.h"
#include "duet/backends/engine_module.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// An engine in which nothing happens.
class Still final : public Backend {
 public:
  explicit Still(const Scene& scene) : Backend(scene) {}
  [[nodiscard]] std::string_view name() const override { return "still"; }
  [[nodiscard]] std::string version() const override { return "1"; }
  JointCommand got;  // of the last step

 private:
  void do_reset() override {}
  void do_set_partner(const HumanJoints&, const HumanJoints&) override {}
  Outcome do_step(const JointCommand& command) override {
    got = command;
    return Outcome::kOk;
  }
  void do_push(int, const Eigen::Vector3d&, const Eigen::Vector3d&) override {}
  void do_kick(const Eigen::Vector3d&) override {}
  void do_snapshot(Snapshot&) const override {}
  void do_restore(std::span<const double>) override {}
};

Scene wheel_scene() {
  Scene scene;
  scene.robot = test::wheel();
  return scene;
}

std::string refused_scene(const std::function<void(Scene&)>& change) {
  Scene scene = wheel_scene();
  change(scene);
  return thrown_message<std::invalid_argument>([&] { Still{scene}; });
}

struct BackendChecks : ::testing::Test {
  std::unique_ptr<Backend> backend = std::make_unique<Still>(wheel_scene());
  RobotState state = test::state_of(*backend->scene().robot, Eigen::Vector3d::Zero());
  JointCommand command = test::no_torque(*backend->scene().robot);
};

TEST(Backend, TheExplicitLawReachesAnEngineAsHeldTorqueWithinTheEffort) {
  Scene scene = wheel_scene();
  scene.law = TorqueLaw::kExplicit;
  Still backend(scene);
  RobotState state = test::state_of(*scene.robot, Eigen::Vector3d::Zero());
  state.q[0] = 0.1;
  state.v[0] = 2.0;
  backend.reset(state);
  JointCommand command = test::no_torque(*scene.robot);
  command.q_target[0] = 0.3;
  command.kp[0] = 20.0;
  command.kd[0] = 0.5;
  command.tau_ff[0] = -1.0;
  backend.step(command);
  EXPECT_DOUBLE_EQ(backend.got.tau_ff[0], 20.0 * 0.2 - 0.5 * 2.0 - 1.0);
  EXPECT_EQ(backend.got.kp[0] + backend.got.kd[0], 0.0);
  const double largest = std::numeric_limits<double>::max();
  for (const double kp : {1e6, largest}) {
    command.kp[0] = kp;
    command.kd[0] = kp == largest ? largest : 0.5;
    backend.step(command);
    EXPECT_LE(std::abs(backend.got.tau_ff[0]), scene.robot->joints[0].effort) << kp;
  }
  scene.law = TorqueLaw::kImplicit;
  Still by_gains(scene);
  by_gains.reset(state);
  by_gains.step(command);
  EXPECT_EQ(by_gains.got.kp[0], command.kp[0]);
}

TEST(Backend, WithArmatureScalesTheCardsAndLeavesTheRobotItself) {
  const std::shared_ptr<const RobotModel> robot = test::wheel();
  EXPECT_EQ(with_armature(robot, 1.0), robot);
  EXPECT_EQ(with_armature(robot, 0.25)->joints[0].armature, 0.25 * robot->joints[0].armature);
  for (const double share : {-0.1, 1.1, kNan})
    EXPECT_THAT(thrown_message<std::invalid_argument>([&] { with_armature(robot, share); }), HasSubstr("in [0, 1]"));
}

TEST(Backend, RefusesASceneWithoutRobot) {
  EXPECT_THAT(refused_scene([](Scene& s) { s.robot = nullptr; }), HasSubstr("no robot"));
}

TEST(Backend, RefusesAStepOutsideItsRange) {
  for (const double dt : {0.0, -0.001, 0.0201, kNan})
    EXPECT_THAT(refused_scene([&](Scene& s) { s.dt = dt; }), HasSubstr("expected in (0, 0.02]")) << dt;
}

TEST(Backend, RefusesNegativeFrictionAndSkinByName) {
  for (const double bad : {-0.1, kNan, kInfinity}) {
    EXPECT_THAT(refused_scene([&](Scene& s) { s.friction.robot_ground = bad; }), HasSubstr("friction robot_ground"));
    EXPECT_THAT(refused_scene([&](Scene& s) { s.friction.robot_human = bad; }), HasSubstr("friction robot_human"));
    EXPECT_THAT(refused_scene([&](Scene& s) { s.friction.robot_robot = bad; }), HasSubstr("friction robot_robot"));
    EXPECT_THAT(refused_scene([&](Scene& s) { s.human.capsules = {{.skin = {.stiffness = bad}}}; }),
                HasSubstr("skin stiffness"));
    EXPECT_THAT(refused_scene([&](Scene& s) { s.human.capsules = {{.skin = {.damping = bad}}}; }),
                HasSubstr("skin damping"));
  }
}

TEST(Backend, RefusesAGravityThatIsNotFinite) {
  EXPECT_THAT(refused_scene([](Scene& s) { s.gravity.y() = kNan; }), HasSubstr("gravity is not finite"));
}

TEST(Backend, RefusesLinksWithoutMassOrInertiaByName) {
  for (const double bad : {0.0, -1.0, kNan, kInfinity}) {
    const auto message = [bad](void (*change)(RobotLink&, double)) {
      return refused_scene([&](Scene& s) {
        const auto robot = test::wheel();
        change(robot->links[1], bad);
        s.robot = robot;
      });
    };
    EXPECT_THAT(message([](RobotLink& link, double value) { link.mass = value; }), HasSubstr("link 'rim' has mass"))
        << bad;
    EXPECT_THAT(message([](RobotLink& link, double value) { link.inertia(1, 1) = value; }),
                HasSubstr("inertia of link 'rim' is not positive definite"))
        << bad;
  }
}

// The physics engines that are here.
std::vector<std::string> physics_engines() {
  std::vector<std::string> names;
  for (const EngineInfo& info : engines())
    if (info.available) names.push_back(info.name);
  return names;
}

TEST(EveryEngine, SkinOfNeitherSpringNorDamperGivesNoForce) {
  Scene scene;
  scene.robot = test::sledge();
  scene.partner = PartnerMode::kSolid;
  scene.human.capsules = {{.name = "left_hand", .region = "hand", .joint_a = 20, .joint_b = 22, .radius = 0.05}};
  scene.human.capsules[0].skin = {.stiffness = 0.0, .damping = 0.0};
  HumanJoints joints = HumanJoints::Zero();  // 10 mm inside the front spheres
  joints.col(20) = Eigen::Vector3d(0.26, 0.4, 0.02);
  joints.col(22) = Eigen::Vector3d(0.26, -0.4, 0.02);
  for (const std::string& engine : physics_engines()) {
    const auto backend = make_backend(engine, scene);
    backend->reset(test::state_of(*scene.robot, {0.0, 0.0, 0.1}));
    backend->set_partner(joints, HumanJoints::Zero());
    int touched = 0;
    for (int i = 0; i < 50; ++i) {
      ASSERT_EQ(backend->step(test::no_torque(*scene.robot)), Outcome::kOk) << engine;
      for (const Contact& contact : backend->contacts()) {
        if (contact.side != ContactSide::kHuman) continue;
        ++touched;
        EXPECT_LT(contact.f_W.norm(), 1e-6) << engine;
      }
    }
    EXPECT_GE(touched, 100) << engine;
    EXPECT_LT(std::abs(backend->state().X_WB.p.x()), 1e-6) << engine;
  }
}

TEST(EveryEngine, StartBeyondAllNumbersDivergesAndDoesNotThrow) {
  const Scene scene = test::g1_scene();
  for (const std::string& engine : physics_engines()) {
    const auto backend = make_backend(engine, scene);
    RobotState state = scene.robot->standing_state();
    state.X_WB.p.x() = 1e200;
    backend->reset(state);
    EXPECT_EQ(backend->step(scene.robot->default_command(scene.robot->neutral)), Outcome::kDiverged) << engine;
    backend->reset(scene.robot->standing_state());
    EXPECT_EQ(backend->step(scene.robot->default_command(scene.robot->neutral)), Outcome::kOk) << engine;
  }
}

TEST_F(BackendChecks, ResetRefusesBadStates) {
  const auto message = [&](const std::function<void(RobotState&)>& change) {
    RobotState bad = state;
    change(bad);
    return thrown_message<std::invalid_argument>([&] { backend->reset(bad); });
  };
  EXPECT_THAT(message([](RobotState& s) { s.q = Eigen::VectorXd::Zero(2); }), HasSubstr("q has 2 entries, expected 1"));
  EXPECT_THAT(message([](RobotState& s) { s.v[0] = kInfinity; }), HasSubstr("v of joint 'axle' is inf"));
  EXPECT_THAT(message([](RobotState& s) { s.X_WB.p.x() = kNan; }), HasSubstr("pose of the base is not finite"));
  EXPECT_THAT(message([](RobotState& s) { s.X_WB.R.coeffs() *= 1.001; }), HasSubstr("norm"));
  EXPECT_THAT(message([](RobotState& s) { s.w_WB_B.z() = kNan; }), HasSubstr("velocity of the base is not finite"));
}

TEST_F(BackendChecks, StepRefusesBadCommandsByJoint) {
  backend->reset(state);
  const auto message = [&](const std::function<void(JointCommand&)>& change) {
    JointCommand bad = command;
    change(bad);
    return thrown_message<std::invalid_argument>([&] { backend->step(bad); });
  };
  EXPECT_THAT(message([](JointCommand& c) { c.q_target.resize(0); }), HasSubstr("q_target has 0 entries, expected 1"));
  EXPECT_THAT(message([](JointCommand& c) { c.q_target[0] = kNan; }), HasSubstr("q_target of joint 'axle' is nan"));
  EXPECT_THAT(message([](JointCommand& c) { c.kp[0] = -1.0; }), HasSubstr("kp of joint 'axle' is -1, expected finite"));
  EXPECT_THAT(message([](JointCommand& c) { c.kd[0] = -1.0; }), HasSubstr("kd of joint 'axle' is -1, expected finite"));
  EXPECT_THAT(message([](JointCommand& c) { c.tau_ff[0] = kInfinity; }), HasSubstr("tau_ff of joint 'axle' is inf"));
  EXPECT_EQ(backend->time(), 0.0);
}

TEST_F(BackendChecks, PartnerPushAndKickRefuseBadValues) {
  HumanJoints joints = HumanJoints::Zero();
  joints(1, 5) = kNan;
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] { backend->set_partner(joints, HumanJoints::Zero()); }),
              HasSubstr("not finite"));
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] { backend->set_partner(HumanJoints::Zero(), joints); }),
              HasSubstr("not finite"));
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] { backend->push(2, zero, zero); }),
              HasSubstr("link 2 of wheel, expected 0 to 1"));
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] { backend->push(-1, zero, zero); }), HasSubstr("link -1"));
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] {
                backend->push(0, {kNan, 0, 0}, zero);
              }),
              HasSubstr("not finite"));
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] {
                backend->kick({0, kInfinity, 0});
              }),
              HasSubstr("Backend::kick: the velocity is not finite"));
}

// The velocity of every part changes by that of the kick, and nothing is begun anew.
TEST(EveryEngine, AKickChangesTheVelocityOfTheWholeRobotAndNothingElse) {
  const Eigen::Vector3d dv(0.4, -0.3, 0.2);
  for (const std::string& engine : physics_engines()) {
    Scene scene = test::g1_scene();
    scene.gravity.setZero();
    const auto backend = make_backend(engine, scene);
    RobotState start = scene.robot->standing_state();
    start.X_WB.p.z() += 1.0;
    start.X_WB.R = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, 3.0).normalized());
    start.w_WB_B = {0.3, -0.2, 0.5};
    start.v.setConstant(0.1);
    backend->reset(start);
    const JointCommand command = test::no_torque(*scene.robot);
    for (int i = 0; i < 10; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk) << engine;
    const RobotState before = backend->state();
    const double time = backend->time();
    const auto straight_on = backend->snapshot();
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    const RobotState unkicked = backend->state();
    backend->restore(straight_on);
    backend->kick(dv);
    EXPECT_EQ(backend->state().v_WB, before.v_WB + dv) << engine;
    EXPECT_EQ(backend->state().v, before.v) << engine;
    EXPECT_EQ(backend->time(), time) << engine;
    ASSERT_EQ(backend->step(command), Outcome::kOk) << engine;
    EXPECT_LT((backend->state().v_WB - unkicked.v_WB - dv).norm(), 1e-6) << engine;
    EXPECT_LT((backend->state().X_WB.p - unkicked.X_WB.p - scene.dt * dv).norm(), 1e-6) << engine;
    EXPECT_LT((backend->state().q - unkicked.q).norm(), 1e-6) << engine;
    EXPECT_LT((backend->state().v - unkicked.v).norm(), 1e-4) << engine;
  }
}

// Where a reset would refuse a robot that overlaps itself or take its contacts' warm starts, a kick keeps them.
TEST(EveryEngine, AKickKeepsPushesAndContacts) {
  for (const std::string& engine : physics_engines()) {
    const Scene scene = test::g1_scene();
    const auto backend = make_backend(engine, scene);
    backend->reset(scene.robot->standing_state());
    const JointCommand command = scene.robot->default_command(scene.robot->neutral);
    for (int i = 0; i < 20; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk) << engine;
    ASSERT_FALSE(backend->contacts().empty()) << engine;
    backend->push(0, {30.0, 0.0, 0.0}, backend->state().X_WB.p);
    backend->kick({0.0, 0.0, 0.0});
    const std::size_t contacts = backend->contacts().size();
    EXPECT_GT(contacts, 0U) << engine;
    const double x = backend->state().X_WB.p.x();
    for (int i = 0; i < 50; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk) << engine;
    EXPECT_GT(backend->state().X_WB.p.x(), x + 1e-4) << engine;
  }
}

TEST_F(BackendChecks, TimeCountsStepsExactly) {
  backend->reset(state);
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(backend->step(command), Outcome::kOk);
  EXPECT_EQ(backend->time(), 1000 * backend->scene().dt);
  backend->reset(state);
  EXPECT_EQ(backend->time(), 0.0);
}

TEST_F(BackendChecks, RestoreRefusesAnotherScenesSnapshot) {
  backend->reset(state);
  Snapshot snapshot = backend->snapshot();
  snapshot.values.push_back(0.0);
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] { backend->restore(snapshot); }),
              HasSubstr(fmt::format("has {} values, expected {}", snapshot.values.size(), snapshot.values.size() - 1)));
}

}  // namespace
}  // namespace duet
