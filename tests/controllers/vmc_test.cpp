// The balance controller in MuJoCo: 2 ms physics, 50 Hz control. The gates are those of the controller's page in docs.
#include "duet/controllers/vmc.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/core/numbers.h"
#include "duet/core/recording.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/kinematics.h"
#include "duet/rollout/world.h"
#include "tests/backends/allocation_count.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr int kStepsPerTick = 10;
constexpr int kRateHz = 50;

double smooth(double s) {
  s = std::clamp(s, 0.0, 1.0);
  return s * s * (3.0 - 2.0 * s);
}

// Random goals of the upper body, one after the other, each reached within 0.6 to 2 s.
class Goals {
 public:
  Goals(const RobotModel& robot, int seed) : robot_(robot), random_(seed, 7), from_(robot.neutral), to_(from_) {}

  Eigen::VectorXd at(double t) {
    if (t >= end_) next(t);
    return from_ + smooth((t - begin_) / (end_ - begin_)) * (to_ - from_);
  }

 private:
  void next(double t) {
    from_ = to_;
    begin_ = t;
    end_ = t + random_.uniform(0.6, 2.0);
    set("waist_yaw_joint", -0.5, 0.5);
    set("waist_roll_joint", -0.15, 0.15);
    set("waist_pitch_joint", -0.1, 0.35);
    for (const std::string side : {"left", "right"}) {
      const double sign = side == "left" ? 1.0 : -1.0;
      set(side + "_shoulder_pitch_joint", -1.8, 0.4);
      set(side + "_shoulder_roll_joint", 0.5 * sign - 0.5, 0.5 * sign + 0.5);
      set(side + "_shoulder_yaw_joint", -0.6, 0.6);
      set(side + "_elbow_joint", -0.3, 1.4);
      for (const char* wrist : {"_wrist_roll_joint", "_wrist_pitch_joint", "_wrist_yaw_joint"})
        set(side + wrist, -0.5, 0.5);
    }
  }
  void set(const std::string& joint, double low, double high) {
    to_[robot_.joint_index(joint)] = random_.uniform(low, high);
  }

  const RobotModel& robot_;
  Random random_;
  Eigen::VectorXd from_, to_;
  double begin_ = 0.0, end_ = 0.0;
};

// One run; hooks are called before each tick.
struct Episode {
  explicit Episode(const Scene& with) : scene(with) {
    backend = make_backend("mujoco", scene);
    controller = make_controller("vmc", scene.robot);
    start(scene.robot->standing_state());
  }
  void start(const RobotState& state) {
    backend->reset(state);
    controller->reset(state);
    reference = {state.X_WB, scene.robot->neutral};
  }
  // Returns whether it still stands.
  bool run(
      double seconds, const std::function<void(double)>& before_tick = [](double) {}) {
    const int ticks = static_cast<int>(std::lround(seconds * kRateHz));
    for (int tick = 0; tick < ticks; ++tick) {
      before_tick(static_cast<double>(tick) / kRateHz);
      controller->act(backend->state(), reference, command);
      if (step_control_period(*backend, kStepsPerTick, command) != Outcome::kOk) return false;
      if (has_fallen(backend->state(), scene.robot->fall)) return false;
    }
    return true;
  }
  void kick(double speed, double direction) {
    backend->kick(speed * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0.0));
  }
  Scene scene;
  std::unique_ptr<Backend> backend;
  std::unique_ptr<Controller> controller;
  Reference reference;
  JointCommand command;
};

double ground_force(const Backend& backend, int axis) {
  double sum = 0.0;
  for (const Contact& contact : backend.contacts())
    if (contact.side == ContactSide::kGround) sum += contact.f_W[axis];
  return sum;
}

struct Vmc : ::testing::Test {
  void SetUp() override {
    if (!engines()[0].available) GTEST_SKIP() << "not run: " << engines()[0].reason;
  }
};

TEST_F(Vmc, StandsStillUnderItsWeight) {
  Episode run(test::g1_scene());
  ASSERT_TRUE(run.run(4.0));
  const double weight = run.scene.robot->total_mass() * kGravity;
  EXPECT_NEAR(ground_force(*run.backend, 2), weight, 1e-3 * weight);
  EXPECT_LT(run.backend->state().v.cwiseAbs().maxCoeff(), 1e-2);
  EXPECT_NEAR(run.backend->state().X_WB.p.z(), run.scene.robot->standing_height, 5e-3);
}

// Mean distance of the keypoints from where the reference has them, with the root where it stood.
double upper_error(const Episode& run, Kinematics& found, Kinematics& expected) {
  const RobotModel& robot = *run.scene.robot;
  const RobotState& state = run.backend->state();
  found.update(state.X_WB, state.q);
  Eigen::VectorXd q = state.q;
  q.tail(17) = run.reference.q.tail(17);
  expected.update(run.reference.X_WB, q);
  double sum = 0.0;
  for (const Keypoint& keypoint : robot.keypoints)
    sum += (found.frame_position(keypoint.frame) - expected.frame_position(keypoint.frame)).norm();
  return sum / static_cast<double>(robot.keypoints.size());
}

TEST_F(Vmc, StandsTenSecondsAndTracksTheUpperBodyForRandomGoals) {
  const Scene scene = test::g1_scene();
  Kinematics found(*scene.robot), expected(*scene.robot);
  int stood = 0, ticks = 0;
  double error = 0.0;
  for (int seed = 0; seed < 16; ++seed) {
    Episode run(scene);
    Goals goals(*scene.robot, seed);
    stood += run.run(10.0, [&](double t) {
      run.reference.q = goals.at(t);
      error += upper_error(run, found, expected);
      ++ticks;
    });
  }
  EXPECT_GE(stood, 15);
  EXPECT_LT(error / ticks, 0.06);  // [m]
}

TEST_F(Vmc, SurvivesKicksOfAThirdOfAMetrePerSecondMostly) {
  int stood = 0;
  for (int seed = 0; seed < 12; ++seed) {
    Episode run(test::g1_scene());
    Goals goals(*run.scene.robot, 100 + seed);
    const double direction = 2.0 * 3.14159 * seed / 12.0;
    stood += run.run(4.0, [&](double t) {
      if (std::lround(t * kRateHz) == kRateHz) run.kick(0.3, direction);
      run.reference.q = goals.at(t);
    });
  }
  EXPECT_GE(stood, 10);
}

TEST_F(Vmc, BendsWithBothArmsForward) {
  Episode run(test::g1_scene());
  const RobotModel& robot = *run.scene.robot;
  ASSERT_TRUE(run.run(5.0, [&](double t) {
    const double s = smooth(t - 0.5);
    run.reference.q[robot.joint_index("waist_pitch_joint")] = 0.5 * s;
    for (const std::string side : {"left", "right"}) {
      run.reference.q[robot.joint_index(side + "_shoulder_pitch_joint")] = -1.5 * s;
      run.reference.q[robot.joint_index(side + "_elbow_joint")] = 1.0 - 0.9 * s;
    }
  }));
  const int waist = robot.joint_index("waist_pitch_joint");
  EXPECT_NEAR(run.backend->state().q[waist], 0.5, 0.05);
  EXPECT_LT(run.backend->state().X_WB.p.x(), -0.03);  // the pelvis goes back
}

TEST_F(Vmc, TurnsThePelvisTowardsTheReferencesYaw) {
  Episode run(test::g1_scene());
  ASSERT_TRUE(run.run(3.0, [&](double t) { run.reference.X_WB.R = yaw_rotation(0.2 * smooth(t)); }));
  EXPECT_NEAR(yaw_of(run.backend->state().X_WB.R), 0.2, 0.05);
}

TEST_F(Vmc, FollowsTheRootWithinTheFeetAndStandsWhenItIsFarAway) {
  Episode run(test::g1_scene());
  ASSERT_TRUE(run.run(3.0, [&](double t) { run.reference.X_WB.p.y() = 0.02 * smooth(t); }));
  EXPECT_NEAR(run.backend->state().X_WB.p.y(), 0.02, 0.01);
  EXPECT_TRUE(run.run(3.0, [&](double t) { run.reference.X_WB.p = Eigen::Vector3d(smooth(t), -smooth(t), 0.8); }));
}

TEST_F(Vmc, HoldsASteadyForceOfAHug) {
  for (const double direction : {0.0, 1.5708, 3.1416}) {
    Episode run(test::g1_scene());
    const int torso = run.scene.robot->frames[run.scene.robot->frame_index("torso_link")].link;
    EXPECT_TRUE(run.run(6.0, [&](double t) {
      const Eigen::Vector3d force =
          25.0 * smooth(t - 1.0) * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0);
      run.backend->push(torso, force, run.backend->state().X_WB.p + Eigen::Vector3d(0.0, 0.0, 0.25));
    })) << direction;
  }
}

// A hand at chest height comes slowly and stays.
TEST_F(Vmc, ReportsAHeldPushOfTheSolidPartnerInBalanceWithTheGround) {
  Scene scene = test::g1_scene(PartnerMode::kSolid);
  HumanCapsule hand;
  hand.name = "left_hand";
  hand.region = "hand";
  hand.joint_a = kLeftWrist;
  hand.joint_b = kLeftHand;
  hand.radius = 0.05;
  scene.human.capsules = {hand};
  Episode run(scene);
  const int torso = scene.robot->frames[scene.robot->frame_index("torso_link")].link;
  HumanJoints joints = HumanJoints::Zero(), velocities = HumanJoints::Zero();
  double human = 0.0, ground = 0.0;
  ASSERT_TRUE(run.run(8.0, [&](double t) {
    const double x = 0.25 - 0.05 * std::min(t, 2.5);
    joints.col(kLeftWrist) = Eigen::Vector3d(x, 0.1, 1.02);
    joints.col(kLeftHand) = Eigen::Vector3d(x, -0.1, 1.02);
    velocities.row(0).setConstant(t < 2.5 ? -0.05 : 0.0);
    run.backend->set_partner(joints, velocities);
    for (const Contact& contact : run.backend->contacts()) {
      if (contact.side != ContactSide::kHuman) continue;
      EXPECT_EQ(contact.link, torso);
      if (t >= 7.0) human += contact.f_W.x();
    }
    if (t >= 7.0) ground += ground_force(*run.backend, 0);
  }));
  EXPECT_LT(human / kRateHz, -3.0);  // [N], pushed back
  EXPECT_NEAR(ground, -human, 0.03 * -human);
}

TEST_F(Vmc, RunsAgainBitwise) {
  const Scene scene = test::g1_scene();
  Episode run(scene);
  const auto once = [&] {
    run.start(scene.robot->standing_state());
    Goals goals(*scene.robot, 3);
    run.run(2.0, [&](double t) { run.reference.q = goals.at(t); });
    return run.backend->state();
  };
  const RobotState first = once();
  EXPECT_TRUE(test::same(once(), first));
}

TEST_F(Vmc, AllocatesNothingAfterTheFirstTick) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: malloc belongs to the sanitizer";
  Episode run(test::g1_scene());
  run.run(0.02);
  const RobotState state = run.backend->state();
  const long before = test::allocation_count();
  for (int i = 0; i < 10; ++i) run.controller->act(state, run.reference, run.command);
  EXPECT_EQ(test::allocation_count(), before);
}

TEST_F(Vmc, CommandsStayFiniteWhenItHasFallen) {
  Episode run(test::g1_scene());
  RobotState state = run.scene.robot->standing_state();
  state.X_WB.R = Eigen::Quaterniond(Eigen::AngleAxisd(1.5, Eigen::Vector3d::UnitY()));
  state.X_WB.p.z() = 0.2;
  run.controller->act(state, run.reference, run.command);
  EXPECT_TRUE(run.command.tau_ff.allFinite());
  EXPECT_TRUE(run.command.q_target.allFinite());
  state.q.setZero();  // straight, singular legs
  run.controller->act(state, run.reference, run.command);
  EXPECT_TRUE(run.command.tau_ff.allFinite());
}

constexpr double kMu = 0.6;

bool inside(const Eigen::Vector3d& f, double slack = 1e-12) {
  return f.z() >= -slack && std::abs(f.x()) <= kMu * f.z() + slack && std::abs(f.y()) <= kMu * f.z() + slack;
}

Eigen::Vector3d random_vector(Random& random) { return {random.normal(), random.normal(), random.normal()}; }

TEST(Pyramid, KeepsWhatIsInsideAndGivesTheTipForThePolarCone) {
  EXPECT_EQ(project_on_pyramid({0.3, -0.5, 1.0}, kMu), Eigen::Vector3d(0.3, -0.5, 1.0));
  EXPECT_EQ(project_on_pyramid({0.0, 0.0, -1.0}, kMu), Eigen::Vector3d::Zero());
  EXPECT_EQ(project_on_pyramid({0.0, 0.0, 0.0}, kMu), Eigen::Vector3d::Zero());
  EXPECT_EQ(project_on_pyramid({0.1, 0.1, -1.0}, kMu), Eigen::Vector3d::Zero());
}

// The projection on a closed convex set is the point whose offset makes no acute angle with any way into the set.
TEST(Pyramid, ProjectionIsTheNearestPoint) {
  Random random(3, 1);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector3d f = random_vector(random);
    const Eigen::Vector3d nearest = project_on_pyramid(f, kMu);
    ASSERT_TRUE(inside(nearest));
    for (int k = 0; k < 20; ++k) {
      const Eigen::Vector3d other = project_on_pyramid(3.0 * random_vector(random), kMu);
      EXPECT_LE((f - nearest).dot(other - nearest), 1e-12);
    }
  }
}

// Two soles of four points each, unit inertia about a point 0.7 m above.
Matrix6Xd soles(double y_of_second) {
  Matrix6Xd G(6, 24);
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d p(i % 2 == 0 ? -0.08 : 0.08, (i < 4 ? 0.1 : y_of_second) + (i % 4 < 2 ? -0.03 : 0.03), -0.7);
    G.block<3, 3>(0, 3 * i) = Eigen::Matrix3d::Identity() / 33.0;
    G.block<3, 3>(3, 3 * i) << 0.0, -p.z(), p.y(), p.z(), 0.0, -p.x(), -p.y(), p.x(), 0.0;
    G.block<3, 3>(3, 3 * i) /= 3.0;
  }
  return G;
}

Eigen::VectorXd even() {
  Eigen::VectorXd f = Eigen::VectorXd::Zero(24);
  for (int i = 0; i < 8; ++i) f[3 * i + 2] = 33.0 * 9.81 / 8;
  return f;
}

TEST(ContactForces, FeasibleMotionIsReached) {
  ContactForces forces(8, kMu, 1e-6, 120);
  forces.restart(even());
  Vector6d b;
  b << 0.5, -0.3, 9.81, 0.0, 0.0, 0.0;
  b.segment<3>(3) << -0.3 * 0.7 * 11.0, -0.5 * 0.7 * 11.0, 0.0;  // what those forces make about the centre at no cost
  const Matrix6Xd G = soles(-0.1);
  const Eigen::VectorXd& f = forces.solve(G, b, Vector6d::Ones(), even());
  EXPECT_LT((G * f - b).norm(), 0.02 * b.norm());
}

TEST(ContactForces, NeverPullOrSlipAndRepeatBitwise) {
  Random random(5, 1);
  for (int trial = 0; trial < 50; ++trial) {
    Vector6d b;
    for (double& value : b) value = 10.0 * random.normal();
    ContactForces first(8, kMu, 1e-6, 120), second(8, kMu, 1e-6, 120);
    first.restart(even());
    second.restart(even());
    const Eigen::VectorXd f = first.solve(soles(-0.1), b, Vector6d::Ones(), even());
    for (int i = 0; i < 8; ++i) EXPECT_TRUE(inside(f.segment<3>(3 * i)));
    EXPECT_EQ(f, second.solve(soles(-0.1), b, Vector6d::Ones(), even()));
  }
}

TEST(ContactForces, CenterOfPressureStopsAtTheEdge) {
  ContactForces forces(8, kMu, 1e-6, 400);
  forces.restart(even());
  Vector6d b;
  b << 0.0, 0.0, 9.81, 0.0, -100.0, 0.0;  // far more moment than the soles' length gives
  const Eigen::VectorXd& f = forces.solve(soles(-0.1), b, Vector6d::Ones(), even());
  double total = 0.0, moment = 0.0;
  for (int i = 0; i < 8; ++i) {
    total += f[3 * i + 2];
    moment += f[3 * i + 2] * (i % 2 == 0 ? -0.08 : 0.08);
  }
  EXPECT_NEAR(moment / total, 0.08, 1e-3);
}

}  // namespace
}  // namespace duet
