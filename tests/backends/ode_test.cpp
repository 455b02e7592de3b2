// ODE against closed forms: fall, one joint under the torque law, stops, drift of hinges, the repeatability of runs and
// what it keeps per process and per thread.
#include <dlfcn.h>

#include <array>
#include <cmath>
#include <thread>

#include "duet/backends/factory.h"
#include "duet/core/random.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/kinematics.h"
#include "tests/backends/contact_scene.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/backends/trace.h"
#include "tests/support.h"

namespace duet {
namespace {

bool ode_is_here() {
  for (const EngineInfo& info : engines())
    if (info.name == "ode") return info.available;
  return false;
}

struct Ode : ::testing::Test {
  void SetUp() override {
    if (!ode_is_here()) GTEST_SKIP() << "not run: engine ode absent";
  }
  static std::unique_ptr<Backend> make(std::shared_ptr<const RobotModel> robot, double dt = 0.002) {
    Scene scene;
    scene.robot = std::move(robot);
    scene.partner = PartnerMode::kNone;
    scene.dt = dt;
    return make_backend("ode", scene);
  }
};

constexpr double kAlgebra = 1e-9;  // rounding of a few hundred steps

TEST_F(Ode, ReportsVelocitiesInOurFrames) {
  // The origin of the base is not its centre of mass, about which it turns.
  auto robot = test::sledge();
  robot->links[0].com = {0.2, 0.0, 0.0};
  const auto backend = make(robot);
  RobotState state = test::state_of(*robot, {0.0, 0.0, 50.0});
  state.X_WB.R = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, -1.0).normalized());
  state.w_WB_B = {0.0, 0.0, 2.0};  // about a principal axis: constant in B
  state.v_WB = -(state.X_WB.R * state.w_WB_B.cross(robot->links[0].com));
  backend->reset(state);
  const Eigen::Vector3d com = state.X_WB * robot->links[0].com;
  for (int i = 0; i < 100; ++i) backend->step(test::no_torque(*robot));
  const double t = backend->time();
  const RobotState& now = backend->state();
  const Eigen::Quaterniond turned = state.X_WB.R * yaw_rotation(2.0 * t);
  EXPECT_NEAR(now.X_WB.R.angularDistance(turned), 0.0, 1e-7);
  EXPECT_NEAR((now.w_WB_B - state.w_WB_B).norm(), 0.0, kAlgebra);
  const Eigen::Vector3d fallen = com - Eigen::Vector3d(0.0, 0.0, 0.5 * kGravity * t * (t + backend->scene().dt));
  EXPECT_NEAR((now.X_WB * robot->links[0].com - fallen).norm(), 0.0, kAlgebra);
  const Eigen::Vector3d v_WCom = now.v_WB + now.X_WB.R * now.w_WB_B.cross(robot->links[0].com);
  EXPECT_NEAR((v_WCom - Eigen::Vector3d(0.0, 0.0, -kGravity * t)).norm(), 0.0, kAlgebra);
}

TEST_F(Ode, TumblingBoxKeepsMomentumAndEnergy) {
  // Without ODE's gyroscopic mode momentum would change by its whole size.
  Scene scene;
  scene.robot = test::sledge();
  scene.partner = PartnerMode::kNone;
  scene.gravity.setZero();
  scene.dt = 0.001;
  const auto backend = make_backend("ode", scene);
  RobotState state = test::state_of(*scene.robot, {0.0, 0.0, 50.0});
  state.w_WB_B = {0.3, 3.0, 0.3};  // about the middle axis: unstable
  backend->reset(state);
  const Eigen::Matrix3d I = scene.robot->links[0].inertia;
  const auto momentum = [&] { return Eigen::Vector3d(backend->state().X_WB.R * (I * backend->state().w_WB_B)); };
  const auto energy = [&] { return 0.5 * backend->state().w_WB_B.dot(I * backend->state().w_WB_B); };
  const Eigen::Vector3d L = momentum();
  const double E = energy();
  double turned_over = 0.0;
  for (int i = 0; i < 10000; ++i) {
    backend->step(test::no_torque(*scene.robot));
    turned_over = std::min(turned_over, backend->state().w_WB_B.y());
  }
  EXPECT_LT(turned_over, -2.0);  // it did tumble
  EXPECT_LT((momentum() - L).norm(), 0.02 * L.norm());
  EXPECT_NEAR(energy(), E, 0.02 * E);
}

struct OdeWheel : Ode {
  void SetUp() override {
    Ode::SetUp();
    if (IsSkipped()) return;
    backend = make(test::wheel());
    backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0}));
    command = test::no_torque(*backend->scene().robot);
  }
  std::unique_ptr<Backend> backend;
  JointCommand command;
};

TEST_F(OdeWheel, StopsAtItsLimits) {
  for (const double side : {1.0, -1.0}) {
    backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0}));
    command.tau_ff[0] = side * 10.0;
    double farthest = 0.0;
    for (int i = 0; i < 1000; ++i) {
      ASSERT_EQ(backend->step(command), Outcome::kOk);
      farthest = std::max(farthest, side * backend->state().q[0]);
    }
    EXPECT_LT(farthest, 1.0 + 0.04);  // arrives at 16 rad/s: 0.032 rad a step
    EXPECT_NEAR(backend->state().q[0], side, 1e-3);
    EXPECT_NEAR(backend->state().v[0], 0.0, 1e-3);
  }
}

TEST_F(Ode, DivergenceIsAValueAndFinalUntilReset) {
  auto robot = test::wheel();
  robot->joints[0].effort = 1e300;
  const auto backend = make(robot);
  const RobotState state = test::state_of(*robot, {0.0, 0.0, 1000.0});
  backend->reset(state);
  JointCommand command = test::no_torque(*robot);
  for (const double torque : {1e8, 1e200, 1e300}) {
    backend->reset(state);
    command.tau_ff[0] = torque;
    Outcome outcome = Outcome::kOk;
    for (int i = 0; i < 10 && outcome == Outcome::kOk; ++i) outcome = backend->step(command);
    EXPECT_EQ(outcome, Outcome::kDiverged) << torque;
    EXPECT_TRUE(backend->state().q.allFinite());
    EXPECT_EQ(backend->step(test::no_torque(*robot)), Outcome::kDiverged);
  }
  backend->reset(state);
  EXPECT_EQ(backend->step(test::no_torque(*robot)), Outcome::kOk);
  EXPECT_LT(std::abs(backend->state().v[0]), 1e-9);  // nothing is left of those torques
}

// At rest there are no velocity products, which ODE takes in one step later.
TEST_F(Ode, AccelerationsFromRestAgreeWithOurDynamics) {
  const auto backend = make(test::g1(), 0.001);
  const RobotModel& robot = *backend->scene().robot;
  Random random(1, 2);
  for (int trial = 0; trial < 3; ++trial) {
    RobotState state = test::state_of(robot, {0.0, 0.0, 50.0});
    state.X_WB.R = Eigen::AngleAxisd(1.0, Eigen::Vector3d(0.1, 0.7, -0.3).normalized());
    JointCommand command = test::no_torque(robot);
    for (int i = 0; i < robot.dof(); ++i) {
      state.q[i] = std::clamp(0.1 * random.normal(), robot.joints[i].lower + 0.05, robot.joints[i].upper - 0.05);
      command.tau_ff[i] = random.normal();
    }
    const int n = 6 + robot.dof();
    Eigen::VectorXd bias(n), force = Eigen::VectorXd::Zero(n);
    Eigen::MatrixXd mass(n, n);
    bias_forces(robot, state, bias);
    mass_matrix(robot, state, mass);
    force.tail(robot.dof()) = command.tau_ff;
    const Eigen::VectorXd expected = mass.llt().solve(force - bias);
    backend->reset(state);
    backend->step(command);
    Eigen::VectorXd found(n);
    found << backend->state().v_WB - state.v_WB, backend->state().w_WB_B - state.w_WB_B, backend->state().v - state.v;
    found /= backend->scene().dt;
    EXPECT_LT((found - expected).norm() / expected.norm(), 1e-6);
  }
}

// Free flight of the moving G1 against our own dynamics: the error halves with dt.
TEST_F(Ode, TrajectoriesConvergeToOurDynamicsAtFirstOrder) {
  const auto robot = test::g1();
  const int n = 6 + robot->dof();
  RobotState start = test::state_of(*robot, {0.0, 0.0, 50.0});
  Random random(3, 1);
  for (int i = 0; i < robot->dof(); ++i) {
    start.q[i] = 0.5 * (robot->joints[i].lower + robot->joints[i].upper);
    start.v[i] = random.normal();
  }
  start.w_WB_B = {1.0, -0.5, 0.7};
  const double duration = 0.1;
  RobotState reference = start;  // semi-implicit Euler at a hundredth of the step
  Dynamics dynamics(*robot);
  const double small = 1e-5;
  for (int i = 0; i < static_cast<int>(std::lround(duration / small)); ++i) {
    dynamics.update(reference);
    Eigen::MatrixXd mass = dynamics.mass();
    for (int j = 0; j < robot->dof(); ++j) mass(6 + j, 6 + j) += robot->joints[j].armature;
    const Eigen::VectorXd a = mass.llt().solve(Eigen::VectorXd(-dynamics.bias()));
    reference.v_WB += small * a.head<3>();
    reference.w_WB_B += small * a.segment<3>(3);
    reference.v += small * a.tail(n - 6);
    reference.X_WB.p += small * reference.v_WB;
    const double angle = small * reference.w_WB_B.norm();
    reference.X_WB.R =
        (reference.X_WB.R * Eigen::Quaterniond(Eigen::AngleAxisd(angle, reference.w_WB_B.normalized()))).normalized();
    reference.q += small * reference.v;
  }
  double errors[2];
  int k = 0;
  for (const double dt : {0.002, 0.001}) {
    const auto backend = make(robot, dt);
    backend->reset(start);
    for (int i = 0; i < static_cast<int>(std::lround(duration / dt)); ++i) backend->step(test::no_torque(*robot));
    errors[k++] = (backend->state().q - reference.q).cwiseAbs().maxCoeff();
  }
  EXPECT_LT(errors[0], 5e-3);
  EXPECT_LT(errors[1], 0.65 * errors[0]);
}

double largest_violation(const RobotModel& robot, const RobotState& state) {
  double largest = 0.0;
  for (int i = 0; i < robot.dof(); ++i)
    largest = std::max({largest, robot.joints[i].lower - state.q[i], state.q[i] - robot.joints[i].upper});
  return largest;
}

TEST_F(Ode, AllJointsHoldAtTheirStops) {
  const auto robot = test::g1();
  const auto backend = make(robot);
  RobotState state = robot->standing_state();
  state.X_WB.p.z() = 50.0;
  backend->reset(state);
  const JointCommand command = robot->default_command(robot->upper() + Eigen::VectorXd::Constant(robot->dof(), 0.3));
  for (int i = 0; i < 500; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk);
  EXPECT_LT(largest_violation(*robot, backend->state()), 0.01);
  EXPECT_LT(backend->state().v.cwiseAbs().maxCoeff(), 0.05);
}

// All joints swing by 0.6 rad, 1.5 times a second, on the ground: the pose of the sole that ODE's own contact point
// tells against the one that the joint angles tell.
TEST_F(Ode, HingesDriftLessThanAMillimetreInThrashing) {
  const Scene scene = test::g1_scene();
  const RobotModel& robot = *scene.robot;
  const auto backend = make_backend("ode", scene);
  backend->reset(robot.standing_state());
  JointCommand command = robot.default_command(robot.neutral);
  Kinematics kinematics(robot);
  RobotState before = backend->state();
  double drift = 0.0;
  int compared = 0;
  for (int i = 0; i < 1000; ++i) {
    for (int k = 0; k < robot.dof(); ++k)
      command.q_target[k] = robot.neutral[k] + 0.6 * std::sin(2.0 * M_PI * 1.5 * i * scene.dt + k);
    before = backend->state();
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    ASSERT_LT(backend->state().v.cwiseAbs().maxCoeff(), 60.0);
    kinematics.update(before.X_WB, before.q);
    for (const Contact& contact : backend->contacts()) {
      if (contact.side != ContactSide::kGround) continue;
      double nearest = 1.0;
      for (const RobotShape& shape : robot.shapes) {
        if (shape.link != contact.link || shape.kind != ShapeKind::kSphere) continue;
        const Eigen::Vector3d center = kinematics.p_WL(shape.link) + kinematics.R_WL(shape.link) * shape.X_LS.p;
        nearest = std::min(nearest, (center.head<2>() - contact.p_WC.head<2>()).norm());
      }
      if (nearest == 1.0) continue;
      drift = std::max(drift, nearest);
      ++compared;
    }
  }
  EXPECT_GT(compared, 50);
  EXPECT_LT(drift, 1e-3);
}

TEST_F(Ode, StandsAndCarriesItsWeight) {
  const Scene scene = test::g1_scene();
  const RobotModel& robot = *scene.robot;
  const auto backend = make_backend("ode", scene);
  backend->reset(robot.standing_state());
  // The card's gains hold a pose, not the balance: an ankle strategy on the centre of mass does.
  JointCommand command = robot.default_command(robot.neutral);
  Kinematics kinematics(robot);
  const std::array<int, 2> pitch = {robot.joint_index("left_ankle_pitch_joint"),
                                    robot.joint_index("right_ankle_pitch_joint")};
  Eigen::MatrixXd J(3, 6 + robot.dof());
  Eigen::VectorXd v(6 + robot.dof());
  double force = 0.0;
  const int steps = 1000;
  for (int i = 0; i < steps; ++i) {
    const RobotState& state = backend->state();
    kinematics.update(state.X_WB, state.q);
    kinematics.center_of_mass_jacobian(J);
    v << state.v_WB, state.w_WB_B, state.v;
    double soles = 0.0;
    for (const int foot : robot.feet)
      soles += kinematics.shape_position(foot).x() / static_cast<double>(robot.feet.size());
    const double ahead = (kinematics.center_of_mass().x() - soles) / 0.65, ahead_rate = J.row(0).dot(v) / 0.65;
    for (const int joint : pitch)
      command.q_target[joint] = robot.neutral[joint] + std::clamp(4.0 * ahead + ahead_rate, -0.3, 0.3);
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    ASSERT_GT(state.X_WB.p.z(), 0.65) << backend->time();
    if (i < steps - 100) continue;
    for (const Contact& contact : backend->contacts()) force += contact.f_W.z() / 100.0;
  }
  const double weight = robot.total_mass() * kGravity;
  EXPECT_NEAR(force, weight, 1e-3 * weight);
}

void append(test::Trace& to, const test::Trace& from) {
  to.states.insert(to.states.end(), from.states.begin(), from.states.end());
  to.contacts.insert(to.contacts.end(), from.contacts.begin(), from.contacts.end());
  to.forces.insert(to.forces.end(), from.forces.begin(), from.forces.end());
}

// ODE's data belong to a thread: a world made here must step, be restored and end there.
TEST_F(Ode, AWorldMayMoveToAnotherThread) {
  const Scene scene = test::g1_scene();
  auto backend = make_backend("ode", scene);
  backend->reset(scene.robot->standing_state());
  const test::Trace first = test::fall(*backend, 0, 50);
  test::Trace there;
  std::thread([&] {
    backend->reset(scene.robot->standing_state());
    there = test::fall(*backend, 0, 50);
  }).join();
  EXPECT_TRUE(same(there, first));
  std::thread([&] {
    backend->restore(backend->snapshot());
    there = test::fall(*backend, 50, 100);
    backend.reset();
  }).join();
  EXPECT_EQ(there.states.size(), 50U);
}

// Worlds without a threading implementation of their own share one list of jobs in the process and crash it.
TEST_F(Ode, ManyWorldsStepInSeveralThreadsAtOnce) {
  constexpr int kThreads = 4, kWorlds = 3, kSteps = 300;
  const Scene scene = test::g1_scene();
  const auto alone = make_backend("ode", scene);
  alone->reset(scene.robot->standing_state());
  const test::Trace expected = test::fall(*alone, 0, kSteps);
  std::array<std::array<test::Trace, kWorlds>, kThreads> found;
  std::vector<std::thread> threads;
  threads.reserve(kThreads);
  for (auto& traces : found)
    threads.emplace_back([&] {
      std::array<std::unique_ptr<Backend>, kWorlds> worlds;
      for (auto& world : worlds) {
        world = make_backend("ode", scene);
        world->reset(scene.robot->standing_state());
      }
      for (int i = 0; i < kSteps; ++i)
        for (int k = 0; k < kWorlds; ++k) append(traces[k], test::fall(*worlds[k], i, i + 1));
    });
  for (std::thread& thread : threads) thread.join();
  for (const auto& traces : found)
    for (const test::Trace& trace : traces) EXPECT_TRUE(same(trace, expected));
  EXPECT_GT(expected.forces.size(), static_cast<size_t>(kSteps));
}

TEST_F(Ode, RefusesOptionsThatItDoesNotHave) {
  Scene scene = test::g1_scene();
  scene.options = {{"contact_erpp", "0.2"}};
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] { make_backend("ode", scene); }).find("contact_erp"),
            std::string::npos);
  scene.options = {{"friction", "cone"}};
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] { make_backend("ode", scene); }).find("friction"),
            std::string::npos);
}

TEST_F(Ode, OptionsReachTheEngine) {
  const auto depth = [](const EngineOptions& options) {
    Scene scene;
    scene.robot = test::sledge();
    scene.partner = PartnerMode::kNone;
    scene.options = options;
    const auto backend = make_backend("ode", scene);
    backend->reset(test::state_of(*scene.robot, {0.0, 0.0, 0.1}));
    for (int i = 0; i < 500; ++i) backend->step(test::no_torque(*scene.robot));
    return backend->contacts()[0].depth;
  };
  // At rest: erp depth / dt = cfm force.
  const double force = 10.0 * kGravity / 4.0;
  EXPECT_NEAR(depth({}), 1e-8 * force * 0.002 / 0.2, 1e-11);
  EXPECT_NEAR(depth({{"contact_cfm", "1e-4"}}), 1e-4 * force * 0.002 / 0.2, 1e-7);
  EXPECT_NEAR(depth({{"contact_cfm", "1e-4"}, {"contact_erp", "0.5"}}), 1e-4 * force * 0.002 / 0.5, 1e-7);
  EXPECT_NEAR(depth({{"contact_cfm", "1e-4"}, {"friction", "bounded"}}), 1e-4 * force * 0.002 / 0.2, 1e-7);
}

// By default ODE prints its errors and ends the process.
TEST_F(Ode, ErrorsOfTheLibraryBecomeExceptionsAndMessagesAreSilent) {
  const auto backend = make(test::sledge());  // the library is loaded and its handlers are set
  void* library = dlopen("libode.so.8", RTLD_LAZY | RTLD_NOLOAD);
  ASSERT_NE(library, nullptr);
  using Step = int (*)(void*, double);
  using Say = void (*)(int, const char*, ...);
  const auto step = reinterpret_cast<Step>(dlsym(library, "dWorldStep"));
  const auto say = reinterpret_cast<Say>(dlsym(library, "dMessage"));
  const auto fail = reinterpret_cast<Say>(dlsym(library, "dError"));
  ASSERT_TRUE(step != nullptr && say != nullptr && fail != nullptr);
  testing::internal::CaptureStderr();
  EXPECT_EQ(test::thrown_message<std::runtime_error>([&] { step(nullptr, 0.002); }).rfind("ode: ", 0), 0U);
  EXPECT_EQ(test::thrown_message<std::runtime_error>([&] { fail(7, "row %d", 3); }), "ode: row 3 (error 7)");
  say(1, "a complaint");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  dlclose(library);
}

struct OdeContact : test::ContactScene {
  OdeContact() : ContactScene("ode") {}
};

TEST_F(OdeContact, BoundedFrictionGivesTheSameForcesAsActive) {
  start(rest);
  backend->push(0, {20.0, 0.0, 0.0}, rest.X_WB.p);
  run(0.2);
  const std::vector<Contact> active(backend->contacts().begin(), backend->contacts().end());
  scene.options = {{"friction", "bounded"}};
  start(rest);
  backend->push(0, {20.0, 0.0, 0.0}, rest.X_WB.p);
  run(0.2);
  ASSERT_EQ(backend->contacts().size(), active.size());
  Eigen::Vector3d a = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < active.size(); ++i) {
    EXPECT_NEAR(active[i].f_W.z(), backend->contacts()[i].f_W.z(), 0.01);
    a += active[i].f_W;
  }
  EXPECT_NEAR((a - test::force_of(*backend, ContactSide::kGround)).norm(), 0.0, 0.01);
}

}  // namespace
}  // namespace duet
