// MuJoCo: its law against the shared one, its options and what they change. Laws of every engine are in
// engine_*_test.cpp.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>

#include "duet/backends/engine_module.h"
#include "duet/backends/physics_backend.h"
#include "duet/core/numbers.h"
#include "duet/robots/dynamics.h"
#include "tests/backends/contact_scene.h"
#include "tests/backends/engine_fixture.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

struct Mujoco : test::OnEngine<::testing::Test> {
  Mujoco() : OnEngine("mujoco") {}
};

TEST_F(Mujoco, LeavesNoLogOfADivergedRun) {
  auto robot = test::wheel();
  robot->joints[0].effort = 1e300;
  const auto backend = make(robot);
  backend->reset(test::state_of(*robot, {0.0, 0.0, 1000.0}));
  JointCommand command = test::no_torque(*robot);
  command.tau_ff[0] = 1e6;
  Outcome outcome = Outcome::kOk;
  for (int i = 0; i < 2000 && outcome == Outcome::kOk; ++i) outcome = backend->step(command);
  EXPECT_EQ(outcome, Outcome::kDiverged);
  EXPECT_FALSE(std::filesystem::exists("MUJOCO_LOG.TXT"));
}

TEST_F(Mujoco, RefusesAModelThatItCannotCompileWithItsMessage) {
  auto robot = test::wheel();
  robot->links[1].inertia = Eigen::Vector3d(1.0, 1.0, 5.0).asDiagonal();  // no body has this
  EXPECT_NE(test::thrown_message<std::runtime_error>([&] { make(robot); }).find("mujoco: refuses the scene"),
            std::string::npos);
}

// The G1 far from stops, thrown and turning, all its targets 0.6 rad away: most joints are at their effort.
struct FarTargets {
  FarTargets() {
    RobotModel free = *test::g1();
    for (RobotJoint& joint : free.joints) {
      joint.lower = -6.0;
      joint.upper = 6.0;
    }
    robot = std::make_shared<const RobotModel>(std::move(free));
    state = test::state_of(*robot, {0.0, 0.0, 50.0});
    state.w_WB_B = {0.5, -1.0, 0.3};
    command = robot->default_command(robot->neutral.array() + 0.6);
  }
  std::shared_ptr<const RobotModel> robot;
  RobotState state;
  JointCommand command;
};

void take_step(const ImplicitLaw& law, double dt, RobotState& state) {
  const Eigen::VectorXd& a = law.acceleration();
  state.v_WB += dt * a.head<3>();
  state.w_WB_B += dt * a.segment<3>(3);
  state.v += dt * a.tail(state.v.size());
  state.X_WB.p += dt * state.v_WB;
  const Eigen::Vector3d turn = dt * state.w_WB_B;
  state.X_WB.R = state.X_WB.R * Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  state.q += dt * state.v;
}

TEST_F(Mujoco, LawAndLimitAreImplicitLawsInFreeFlight) {
  const FarTargets far;
  Scene scene;
  scene.robot = far.robot;
  scene.self_collision = false;
  const auto backend = make_backend("mujoco", scene);
  backend->reset(far.state);
  ImplicitLaw law(scene);
  RobotState state = far.state;
  Eigen::VectorXd torques(29);
  int saturated = 0;
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(backend->step(far.command), Outcome::kOk);
    ASSERT_TRUE(law.begin(state, far.command));
    law.solve(Eigen::VectorXd::Zero(35));
    law.torques(law.acceleration(), torques);
    take_step(law, scene.dt, state);
    for (int k = 0; k < 29; ++k) {
      saturated += std::abs(torques[k]) == scene.robot->joints[k].effort;
      ASSERT_LE(std::abs(backend->torques()[k]), scene.robot->joints[k].effort * (1.0 + 1e-9));
    }
    ASSERT_LT((backend->torques() - torques).cwiseAbs().maxCoeff(), 1e-5) << i;
    ASSERT_LT((backend->state().q - state.q).cwiseAbs().maxCoeff(), 1e-7) << i;
  }
  EXPECT_GT(saturated, 50);
}

TEST_F(Mujoco, SaturatedStepConvergesToTheLawWithFineSteps) {
  const FarTargets far;
  Scene scene;
  scene.robot = far.robot;
  scene.self_collision = false;
  Scene fine = scene;
  fine.dt = 1e-4;
  ImplicitLaw law(fine);
  RobotState state = far.state;
  for (int i = 0; i < 2000; ++i) {
    ASSERT_TRUE(law.begin(state, far.command));
    law.solve(Eigen::VectorXd::Zero(35));
    take_step(law, fine.dt, state);
  }
  for (const double dt : {0.0005, 0.001, 0.002}) {
    scene.dt = dt;
    const auto backend = make_backend("mujoco", scene);
    backend->reset(far.state);
    for (int i = 0; i < std::lround(0.2 / dt); ++i) backend->step(far.command);
    const double error = (backend->state().q - state.q).cwiseAbs().maxCoeff();
    RecordProperty(fmt::format("error_at_{}_us", std::lround(1e6 * dt)), fmt::format("{:.5f}", error));
    EXPECT_LT(error, 15.0 * dt);
  }
}

TEST_F(Mujoco, NamesItsOptionsAndTheirValues) {
  const auto message = [](const EngineOptions& options) {
    Scene scene;
    scene.robot = test::sledge();
    scene.options = options;
    return test::thrown_message<std::invalid_argument>([&] { make_backend("mujoco", scene); });
  };
  EXPECT_THAT(message({{"solvr", "cg"}}), ::testing::HasSubstr("did you mean 'solver'"));
  EXPECT_THAT(message({{"solver", "lemke"}}),
              ::testing::HasSubstr("engine 'mujoco': unknown solver 'lemke'. Known: newton, cg, pgs"));
  EXPECT_THAT(message({{"iterations", "1.5"}}),
              ::testing::HasSubstr("option 'iterations': expected a whole number, 1 to 1000, found 1.5"));
}

// Where a standing G1 is after 0.1 s under these settings.
RobotState stood(const EngineOptions& options) {
  Scene scene = test::g1_scene();
  scene.options = options;
  const auto backend = make_backend("mujoco", scene);
  RobotState state = scene.robot->standing_state();
  state.v_WB = {0.3, 0.2, -0.3};
  backend->reset(state);
  const JointCommand command = scene.robot->default_command(scene.robot->neutral);
  for (int i = 0; i < 50; ++i) EXPECT_EQ(backend->step(command), Outcome::kOk);
  return backend->state();
}

TEST_F(Mujoco, EachOptionChangesTheRunAndOnlySlightly) {
  const RobotState usual = stood({});
  EXPECT_TRUE(test::same(stood({{"solver", "newton"}, {"iterations", "20"}}), usual));
  const EngineOptions changed[] = {{{"solver", "cg"}},
                                   {{"solver", "pgs"}, {"iterations", "200"}},
                                   {{"iterations", "1"}},
                                   {{"tolerance", "0.1"}},
                                   {{"impratio", "1"}},
                                   {{"cone", "pyramidal"}},
                                   {{"jacobian", "sparse"}},
                                   {{"integrator", "implicit"}},
                                   {{"ground_time_constant", "0.02"}}};
  for (const EngineOptions& options : changed) {
    const RobotState state = stood(options);
    const std::string& name = options.begin()->second;
    EXPECT_FALSE(test::same(state, usual)) << name;
    EXPECT_LT((state.X_WB.p - usual.X_WB.p).norm(), 0.01) << name;
  }
}

TEST_F(Mujoco, SofterGroundSinksDeeper) {
  double depth[2];
  for (const int i : {0, 1}) {
    Scene scene;
    scene.robot = test::sledge();
    scene.options = {{"ground_time_constant", i == 0 ? "0.005" : "0.04"}};
    const auto backend = make_backend("mujoco", scene);
    backend->reset(test::state_of(*scene.robot, {0.0, 0.0, 0.1}));
    for (int k = 0; k < 500; ++k) backend->step(test::no_torque(*scene.robot));
    ASSERT_EQ(backend->contacts().size(), 4U);
    depth[i] = backend->contacts()[0].depth;
  }
  EXPECT_GT(depth[1], 10.0 * depth[0]);
}

struct MujocoContact : test::ContactScene {
  MujocoContact() : ContactScene("mujoco") {}
};

TEST_F(MujocoContact, SkinIsThatOfTheCapsuleInEverySolverAndCone) {
  scene.partner = PartnerMode::kSolid;
  scene.friction.robot_ground = 10.0;
  for (const double stiffness : {1e4, 7.5e4})
    for (const char* solver : {"newton", "cg", "pgs"})
      for (const char* cone : {"elliptic", "pyramidal"}) {
        scene.options = {{"solver", solver}, {"cone", cone}, {"iterations", "500"}, {"tolerance", "1e-12"}};
        scene.human.capsules[0].skin.stiffness = stiffness;
        start(rest);
        run(0.2);
        backend->set_partner(test::hand_before_sledge(backend->state(), -0.001), HumanJoints::Zero());
        run(0.5);
        int touching = 0;
        for (const Contact& contact : backend->contacts()) {
          if (contact.side != ContactSide::kHuman) continue;
          ++touching;
          EXPECT_NEAR(-contact.f_W.x(), stiffness * contact.depth, 0.01 * stiffness * contact.depth)
              << solver << " " << cone;
        }
        EXPECT_EQ(touching, 2);
      }
}

}  // namespace
}  // namespace duet
