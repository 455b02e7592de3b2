// StartMode::kAct: for controllers that cannot walk.
#include "duet/policies/phase_adaptation.h"
#include "duet/robots/roles.h"
#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;
using test::kAlgebra;
using test::swinging_motion;

constexpr int kFrames = 300;
constexpr Phases kPhases{120, 200};

AdaptedMotion in_place(const RobotMotion& motion, AdaptationOptions options = {}) {
  options.start = StartMode::kAct;
  return adapt_by_phase(motion, kPhases, *g1(), options, 1);
}

// A motion whose pelvis pitches by `pitch` during the act, waist at 0.
RobotMotion bending_motion(double pitch) {
  RobotMotion motion = swinging_motion(kFrames, 1);
  for (int t = 0; t < kFrames; ++t) {
    motion.root[static_cast<std::size_t>(t)].R =
        yaw_rotation(0.8) * Eigen::AngleAxisd(pitch * std::sin(t / 20.0), Eigen::Vector3d::UnitY());
    for (const char* name : {"waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint"})
      motion.q(g1()->joint_index(name), t) = 0.0;
  }
  return motion;
}

TEST(StanceAdaptation, CutsTheClipAtTheLead) {
  const RobotMotion motion = swinging_motion(kFrames, 1);
  for (const auto& [lead, frames] : {std::pair{1.0, 50}, {0.5, 25}, {0.0, 0}, {2.4, 120}, {100.0, 120}}) {
    const AdaptedMotion result = in_place(motion, {.lead = lead});
    EXPECT_EQ(result.clip_frame, 120 - frames);
    EXPECT_EQ(result.phases, (Phases{frames, frames + 80}));
    EXPECT_EQ(result.motion.frames(), kFrames - 120 + frames);
  }
}

TEST(StanceAdaptation, RootStandsUprightWhereItIsInMidAct) {
  const RobotMotion motion = swinging_motion(kFrames, 2);
  const Pose& act = motion.root[(kPhases.act_begin + kPhases.act_end) / 2];
  for (const Pose& root : in_place(motion).motion.root) {
    EXPECT_EQ(root.p, Eigen::Vector3d(act.p.x(), act.p.y(), g1()->standing_height));
    EXPECT_NEAR(root.R.angularDistance(yaw_rotation(yaw_of(act.R))), 0.0, 1e-7);
  }
}

TEST(StanceAdaptation, LegsStand) {
  const RobotMotion result = in_place(swinging_motion(kFrames, 2)).motion;
  for (int j = 0; j < g1()->dof(); ++j)
    if (test::is_leg(j)) {
      EXPECT_TRUE((result.q.row(j).array() == g1()->neutral[j]).all());
    }
}

TEST(StanceAdaptation, ArmsRampThroughTheActAndBack) {
  const RobotMotion motion = swinging_motion(kFrames, 3);
  const RobotMotion result = in_place(motion).motion;
  const int offset = 70;  // clip_frame
  for (const char* name : {"left_shoulder_pitch_joint", "right_elbow_joint", "left_wrist_yaw_joint"}) {
    const int j = g1()->joint_index(name);
    const double neutral = g1()->neutral[j];
    EXPECT_EQ(result.q(j, 0), neutral);
    EXPECT_NEAR(result.q(j, 25), 0.5 * (neutral + motion.q(j, kPhases.act_begin)), kAlgebra);
    for (int t = kPhases.act_begin; t < kPhases.act_end; ++t) EXPECT_EQ(result.q(j, t - offset), motion.q(j, t));
    EXPECT_NEAR(result.q(j, 130 + 24), 0.5 * (neutral + motion.q(j, kPhases.act_end - 1)), kAlgebra);
    EXPECT_EQ(result.q(j, 130 + 49), neutral);
    EXPECT_EQ(result.q(j, result.frames() - 1), neutral);
  }
}

TEST(StanceAdaptation, WaistTakesOverTheTiltOfThePelvis) {
  const RobotMotion motion = bending_motion(0.45);  // inside the waist's limit of 0.52
  const AdaptedMotion result = in_place(motion);
  const TorsoOrientation torso(*g1());
  for (int t = kPhases.act_begin; t < kPhases.act_end; ++t) {
    const auto f = static_cast<std::size_t>(t - result.clip_frame);
    const Eigen::Quaterniond wanted = motion.root[static_cast<std::size_t>(t)].R * torso.at(motion.q.col(t));
    const Eigen::Quaterniond found =
        result.motion.root[f].R * torso.at(result.motion.q.col(static_cast<Eigen::Index>(f)));
    EXPECT_NEAR(found.angularDistance(wanted), 0.0, 1e-7) << t;
  }
}

TEST(StanceAdaptation, WaistBendsToItsLimitWhereThePelvisBendsFurther) {
  const RobotMotion motion = bending_motion(1.2);
  const int pitch = g1()->joint_index("waist_pitch_joint");
  const RobotMotion bent = in_place(motion).motion, as_in_clip = in_place(motion, {.keep_torso = false}).motion;
  EXPECT_NEAR(bent.q.row(pitch).maxCoeff(), g1()->joints[static_cast<std::size_t>(pitch)].upper, 1e-12);
  EXPECT_EQ(as_in_clip.q.row(pitch).maxCoeff(), 0.0);
}

TEST(StanceAdaptation, WithoutStanceTheActIsKeptToTheBit) {
  const RobotMotion motion = swinging_motion(kFrames, 4);
  const AdaptedMotion result = in_place(motion, {.hold_stance = false});
  for (int t = 0; t < result.motion.frames(); ++t) {
    const int source = std::clamp(t + result.clip_frame, kPhases.act_begin, kPhases.act_end - 1);
    EXPECT_EQ(result.motion.root[static_cast<std::size_t>(t)].p, motion.root[static_cast<std::size_t>(source)].p);
    const int leg = g1()->joint_index("left_knee_joint"), arm = g1()->joint_index("left_elbow_joint");
    EXPECT_EQ(result.motion.q(leg, t), motion.q(leg, source));
    if (result.phases.at(t) == Phase::kAct) {
      EXPECT_EQ(result.motion.q.col(t), motion.q.col(source));
    }
    if (t == 0) {
      EXPECT_EQ(result.motion.q(arm, t), g1()->neutral[arm]);
    }
  }
}

// A T1 that turns and leans forward while its waist swings.
RobotMotion turning_t1() {
  const RobotModel& robot = *test::t1();
  RobotMotion motion{50.0, robot.joint_names(), std::vector<Pose>(kFrames), robot.neutral.replicate(1, kFrames)};
  for (int t = 0; t < kFrames; ++t) {
    const double s = t / 50.0;
    motion.q(robot.joint_index("Waist"), t) = 0.4 * std::sin(2.0 * s);
    motion.q(robot.joint_index("Left_Knee_Pitch"), t) = 0.8;
    motion.root[static_cast<std::size_t>(t)] = {
        yaw_rotation(0.5 + 0.1 * s) * Eigen::AngleAxisd(0.2 * std::sin(s), Eigen::Vector3d::UnitY()),
        {1.0 + 0.1 * s, -2.0, 0.66}};
  }
  return motion;
}

// Where the base is the trunk, the pelvis stands and the trunk turns over it.
TEST(StanceAdaptation, ThePelvisBelowAWaistStandsStillAndUpright) {
  const RobotModel& robot = *test::t1();
  const RobotMotion motion = turning_t1();
  const AdaptedMotion result = adapt_by_phase(motion, kPhases, robot, {.start = StartMode::kAct}, 1);
  const auto pelvis = [&](int t) {
    return result.motion.root[static_cast<std::size_t>(t)] * pelvis_in_base(robot, result.motion.q.col(t));
  };
  const Pose first = pelvis(0);
  for (int t = 0; t < result.motion.frames(); ++t) {
    EXPECT_LT((pelvis(t).p - first.p).norm(), test::kAlgebra);
    EXPECT_NEAR(pelvis(t).R.angularDistance(first.R), 0.0, 1e-7);
    for (const int j : leg_joints(robot)) EXPECT_EQ(result.motion.q(j, t), robot.neutral[j]);
  }
  EXPECT_NEAR((first.R * Eigen::Vector3d::UnitZ()).z(), 1.0, 1e-12);
  EXPECT_NEAR(first.p.z(), robot.standing_height - 0.1155, 1e-12);
  const auto middle = static_cast<std::size_t>((kPhases.act_begin + kPhases.act_end) / 2);
  const Pose then = motion.root[middle] * pelvis_in_base(robot, motion.q.col(static_cast<Eigen::Index>(middle)));
  EXPECT_LT((first.p - then.p).head<2>().norm(), test::kAlgebra);
  // The trunk keeps its heading as far as the waist goes.
  for (int t = kPhases.act_begin; t < kPhases.act_end; ++t) {
    const auto f = static_cast<std::size_t>(t - result.clip_frame);
    EXPECT_NEAR(yaw_of(result.motion.root[f].R), yaw_of(motion.root[static_cast<std::size_t>(t)].R), 0.02) << t;
  }
}

}  // namespace
}  // namespace duet
