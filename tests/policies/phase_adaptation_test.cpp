#include "duet/policies/phase_adaptation.h"

#include <functional>
#include <limits>

#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;
using test::kAlgebra;
using test::swinging_motion;

constexpr int kFrames = 300;
constexpr Phases kPhases{120, 200};

AdaptedMotion adapted(const RobotMotion& motion, const AdaptationOptions& options, std::uint64_t seed = 1,
                      const Phases& phases = kPhases) {
  return adapt_by_phase(motion, phases, *g1(), options, seed);
}

void expect_same_frame(const RobotMotion& a, int frame_a, const RobotMotion& b, int frame_b) {
  const Reference x = a.reference(frame_a), y = b.reference(frame_b);
  EXPECT_EQ(x.q, y.q) << frame_a;
  EXPECT_EQ(x.X_WB.p, y.X_WB.p) << frame_a;
  EXPECT_EQ(x.X_WB.R.coeffs(), y.X_WB.R.coeffs()) << frame_a;
}

// Largest change of a joint from one frame to the next.
double largest_step(const RobotMotion& motion, int begin, int end) {
  double largest = 0.0;
  for (int t = begin + 1; t < end; ++t)
    largest = std::max(largest, (motion.q.col(t) - motion.q.col(t - 1)).cwiseAbs().maxCoeff());
  return largest;
}

TEST(ClipAdaptation, IsTheClip) {
  const RobotMotion motion = swinging_motion(kFrames, 1);
  const AdaptedMotion result = adapted(motion, {.start = StartMode::kClip});
  EXPECT_EQ(result.phases, kPhases);
  EXPECT_EQ(result.clip_frame, 0);
  ASSERT_EQ(result.motion.frames(), kFrames);
  for (int t = 0; t < kFrames; ++t) expect_same_frame(result.motion, t, motion, t);
}

TEST(ApproachAdaptation, KeepsTheActToTheBit) {
  const RobotMotion motion = swinging_motion(kFrames, 1);
  const AdaptedMotion result = adapted(motion, {});
  EXPECT_EQ(result.phases, kPhases);
  EXPECT_EQ(result.clip_frame, 0);
  ASSERT_EQ(result.motion.frames(), kFrames);
  for (int t = kPhases.act_begin; t < kPhases.act_end; ++t) expect_same_frame(result.motion, t, motion, t);
}

TEST(ApproachAdaptation, StartsInTheDiscAsTheClipIsTurned) {
  const RobotMotion motion = swinging_motion(kFrames, 1);
  const Pose& original = motion.root.front();
  double inside_half_radius = 0.0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  constexpr int kSeeds = 400;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const Pose start = adapted(motion, {.start_radius = 0.8}, static_cast<std::uint64_t>(seed)).motion.root.front();
    const Eigen::Vector3d offset = start.p - original.p;
    EXPECT_LE(offset.norm(), 0.8);
    EXPECT_EQ(offset.z(), 0.0);
    EXPECT_NEAR(start.R.angularDistance(original.R), 0.0, 1e-7);
    inside_half_radius += offset.norm() < 0.4 ? 1.0 / kSeeds : 0.0;
    mean += offset / kSeeds;
  }
  // Uniform over the area: a quarter lies inside half the radius, the mean at the centre. Four standard errors.
  EXPECT_NEAR(inside_half_radius, 0.25, 4.0 * std::sqrt(0.25 * 0.75 / kSeeds));
  EXPECT_LT(mean.norm(), 4.0 * 0.8 / std::sqrt(2.0 * kSeeds));
}

TEST(ApproachAdaptation, GoesStraightFromNeutralToTheAct) {
  const RobotMotion motion = swinging_motion(kFrames, 2);
  const RobotMotion result = adapted(motion, {}).motion;
  const Pose start = result.root.front(), goal = motion.root[kPhases.act_begin];
  for (int t = 0; t < kPhases.act_begin; ++t) {
    const double s = static_cast<double>(t) / kPhases.act_begin;
    const Pose expected = interpolate(start, goal, s);
    EXPECT_NEAR((result.root[static_cast<std::size_t>(t)].p - expected.p).norm(), 0.0, kAlgebra);
    EXPECT_NEAR(result.root[static_cast<std::size_t>(t)].R.angularDistance(expected.R), 0.0, 1e-7);
    for (int j = 0; j < g1()->dof(); ++j) {
      const bool leg = test::is_leg(j);
      const double angle = leg ? motion.q(j, t) : (1.0 - s) * g1()->neutral[j] + s * motion.q(j, kPhases.act_begin);
      EXPECT_NEAR(result.q(j, t), angle, kAlgebra);
    }
  }
}

TEST(ApproachAdaptation, WhoWalksIsThereEarlyAndWaitsWithItsArmsDown) {
  const RobotMotion motion = swinging_motion(kFrames, 2);
  const RobotMotion result = adapted(motion, {.walks = 1e3}).motion;  // there after the quickest way, one second
  constexpr int kThere = 50;
  ASSERT_GT(kPhases.act_begin, kThere + 1);
  const Pose& goal = motion.root[kPhases.act_begin];
  EXPECT_GT((result.root[kThere / 2].p - goal.p).norm(), 1e-3);
  std::vector<int> arms;
  for (int j = 0; j < g1()->dof(); ++j)
    if (!test::is_leg(j)) arms.push_back(j);
  for (int t = 0; t < kPhases.act_begin; ++t) {
    if (t >= kThere) {
      EXPECT_EQ(result.root[static_cast<std::size_t>(t)].p, goal.p) << t;
    }
    for (const int j : arms) EXPECT_EQ(result.q(j, t), g1()->neutral[j]) << t;
  }
  for (const int j : arms) EXPECT_EQ(result.q(j, kPhases.act_begin + 20), motion.q(j, kPhases.act_begin + 20));
  EXPECT_THROW(adapted(motion, {.walks = -1.0}), std::invalid_argument);
}

TEST(ApproachAdaptation, StandsStillAfterTheActAndReturnsToNeutral) {
  const RobotMotion motion = swinging_motion(kFrames, 3);
  const RobotMotion result = adapted(motion, {.return_time = 1.2}).motion;
  const int last = kPhases.act_end - 1;
  for (int t = kPhases.act_end; t < kFrames; ++t) {
    EXPECT_EQ(result.root[static_cast<std::size_t>(t)].p, motion.root[static_cast<std::size_t>(last)].p);
    const double s = std::min(1.0, (t - last) / 60.0);
    for (int j = 0; j < g1()->dof(); ++j) {
      const bool leg = test::is_leg(j);
      EXPECT_NEAR(result.q(j, t), motion.q(j, last) + (leg ? 0.0 : s * (g1()->neutral[j] - motion.q(j, last))),
                  kAlgebra);
    }
  }
}

TEST(ApproachAdaptation, SameSeedGivesTheSameBits) {
  const RobotMotion motion = swinging_motion(kFrames, 4);
  const RobotMotion a = adapted(motion, {}, 7).motion, b = adapted(motion, {}, 7).motion,
                    c = adapted(motion, {}, 8).motion;
  for (int t = 0; t < kFrames; ++t) expect_same_frame(a, t, b, t);
  EXPECT_NE(a.root.front().p, c.root.front().p);
}

TEST(SimToRealAdaptation, WalksStraightTurnsMildlyAndRaisesTheArmsInTheLastSixteenFrames) {
  RobotMotion motion = swinging_motion(kFrames, 4);
  const Pose goal = motion.root[kPhases.act_begin];
  motion.root.front().R = yaw_rotation(2.0) * goal.R;
  const RobotMotion result = adapted(motion, {.start = StartMode::kSimToReal}).motion;
  EXPECT_NEAR(result.root.front().R.angularDistance(goal.R), 0.35, 1e-9);
  for (int t = 0; t < kPhases.act_begin; ++t) {
    const double s = static_cast<double>(t) / kPhases.act_begin;
    EXPECT_NEAR((result.root[t].p - (1.0 - s) * motion.root.front().p - s * goal.p).norm(), 0.0, kAlgebra);
    const double up = std::max(0.0, (t - (kPhases.act_begin - 16)) / 16.0);
    for (int j = 0; j < g1()->dof(); ++j) {
      const double raised = (1.0 - up) * g1()->neutral[j] + up * motion.q(j, kPhases.act_begin);
      EXPECT_NEAR(result.q(j, t), test::is_leg(j) ? motion.q(j, t) : raised, kAlgebra);
    }
  }
  for (int t = kPhases.act_begin; t < kPhases.act_end; ++t) expect_same_frame(result, t, motion, t);
}

TEST(SimToRealAdaptation, StandsStillAfterTheActAndLowersTheArmsInSixteenFrames) {
  const RobotMotion motion = swinging_motion(kFrames, 5);
  const RobotMotion result = adapted(motion, {.start = StartMode::kSimToReal}).motion;
  const int last = kPhases.act_end - 1;
  for (int j = 0; j < g1()->dof(); ++j) {
    const bool leg = test::is_leg(j);
    EXPECT_NEAR(result.q(j, last + 8), leg ? motion.q(j, last) : 0.5 * (motion.q(j, last) + g1()->neutral[j]),
                kAlgebra);
    EXPECT_NEAR(result.q(j, last + 16), leg ? motion.q(j, last) : g1()->neutral[j], kAlgebra);
  }
  EXPECT_EQ(result.root.back().p, motion.root[last].p);
}

TEST(SimToRealAdaptation, IsTheSameForEverySeedAndLeavesAMildStartAsItIs) {
  RobotMotion motion = swinging_motion(kFrames, 6);
  motion.root.front().R = yaw_rotation(-0.2) * motion.root[kPhases.act_begin].R;
  const RobotMotion first = adapted(motion, {.start = StartMode::kSimToReal}, 1).motion;
  const RobotMotion second = adapted(motion, {.start = StartMode::kSimToReal}, 2).motion;
  EXPECT_EQ(first.q, second.q);
  EXPECT_EQ(first.root[7].p, second.root[7].p);
  EXPECT_NEAR(first.root.front().R.angularDistance(motion.root.front().R), 0.0, 1e-7);
}

TEST(ApproachAdaptation, WorksWithoutPreparationOrFollowUp) {
  const RobotMotion motion = swinging_motion(50, 5);
  const AdaptedMotion result = adapted(motion, {}, 1, {0, 50});
  for (int t = 0; t < 50; ++t) expect_same_frame(result.motion, t, motion, t);
}

TEST(PhaseAdaptation, KeepsJointLimitsAndNeverJumps) {
  for (const StartMode start : {StartMode::kApproach, StartMode::kAct, StartMode::kSimToReal})
    for (const bool hold_stance : {false, true})
      for (std::uint64_t seed = 0; seed < 5; ++seed) {
        const RobotMotion motion = swinging_motion(kFrames, seed);
        const AdaptedMotion result = adapted(motion, {.start = start, .hold_stance = hold_stance}, seed);
        EXPECT_NO_THROW(validate(result.motion, "adapted"));
        const Eigen::VectorXd lower = g1()->lower().array() - kAlgebra, upper = g1()->upper().array() + kAlgebra;
        for (int t = 0; t < result.motion.frames(); ++t) {
          EXPECT_TRUE((result.motion.q.col(t).array() >= lower.array()).all()) << t;
          EXPECT_TRUE((result.motion.q.col(t).array() <= upper.array()).all()) << t;
        }
        // A ramp of 1 s over the widest range of a joint, or the clip's own steps (the waist's change with the root's).
        const double ramp = (g1()->upper() - g1()->lower()).maxCoeff() / 50.0;
        EXPECT_LE(largest_step(result.motion, 0, result.motion.frames()),
                  std::max(ramp, 2.0 * largest_step(motion, 0, kFrames)));
      }
}

std::string refusal(const std::function<void(RobotMotion&, Phases&, AdaptationOptions&)>& change) {
  RobotMotion motion = swinging_motion(50, 1);
  Phases phases{10, 30};
  AdaptationOptions options;
  change(motion, phases, options);
  return test::thrown_message<std::invalid_argument>([&] { adapt_by_phase(motion, phases, *g1(), options, 1); });
}

TEST(PhaseAdaptation, RefusesPhasesThatDoNotFit) {
  using M = RobotMotion;
  using O = AdaptationOptions;
  const std::string expected = "phase adaptation: expected an act inside [0, 50), found ";
  EXPECT_EQ(refusal([](M&, Phases& p, O&) { p = {-1, 10}; }), expected + "[-1, 10)");
  EXPECT_EQ(refusal([](M&, Phases& p, O&) { p = {10, 10}; }), expected + "[10, 10)");
  EXPECT_EQ(refusal([](M&, Phases& p, O&) { p = {10, 51}; }), expected + "[10, 51)");
}

TEST(PhaseAdaptation, RefusesOptionsAndMotionsThatDoNotFit) {
  using M = RobotMotion;
  using O = AdaptationOptions;
  EXPECT_SENTENCE(refusal([](M&, Phases&, O& o) { o.start_radius = -0.1; }));
  EXPECT_SENTENCE(refusal([](M&, Phases&, O& o) { o.lead = std::nan(""); }));
  EXPECT_SENTENCE(refusal([](M&, Phases&, O& o) { o.return_time = std::numeric_limits<double>::infinity(); }));
  EXPECT_SENTENCE(refusal([](M& m, Phases&, O&) { m.rate_hz = 30; }));
  EXPECT_SENTENCE(refusal([](M& m, Phases&, O&) { std::swap(m.joint_names[0], m.joint_names[1]); }));
  EXPECT_EQ(refusal([](M& m, Phases&, O&) { m.joint_names.pop_back(), m.q = m.q.topRows(28).eval(); }),
            "phase adaptation: expected the 29 joints of robot '" + g1()->name + "', found 28");
  EXPECT_SENTENCE(refusal([](M& m, Phases&, O&) { m.q(0, 3) = std::nan(""); }));
}

constexpr double kSolved = 1e-7;  // angularDistance near 0 is sqrt(epsilon)

Eigen::VectorXd random_angles(Random& random, double share) {
  const RobotModel& robot = *g1();
  Eigen::VectorXd q(robot.dof());
  for (int j = 0; j < robot.dof(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    q[j] = 0.5 * (joint.lower + joint.upper) + 0.5 * share * (joint.upper - joint.lower) * random.uniform(-1.0, 1.0);
  }
  return q;
}

int joint(const char* name) { return g1()->joint_index(name); }

TEST(TorsoOrientation, IsTheProductOfTheWaistsHinges) {
  const TorsoOrientation torso(*g1());
  Eigen::VectorXd q = g1()->neutral;
  q[joint("waist_yaw_joint")] = 0.7;
  q[joint("waist_roll_joint")] = -0.3;
  q[joint("waist_pitch_joint")] = 0.4;
  const Eigen::Quaterniond expected = Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) *
                                      Eigen::AngleAxisd(-0.3, Eigen::Vector3d::UnitX()) *
                                      Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY());
  EXPECT_NEAR(torso.at(q).angularDistance(expected), 0.0, kSolved);
}

TEST(TorsoOrientation, FindsEveryOrientationInsideTheLimitsFromWithinARightAngle) {
  const TorsoOrientation torso(*g1());
  Random random(1, 1);
  int solved = 0;
  for (int i = 0; i < 1000; ++i) {
    Eigen::VectorXd q = random_angles(random, 0.95), q_goal = random_angles(random, 0.95);
    // Further round, the short way to the goal may lead through the part of the circle that the yaw cannot reach.
    for (Eigen::VectorXd* angles : {&q, &q_goal}) (*angles)[joint("waist_yaw_joint")] *= 0.5;
    const Eigen::Quaterniond goal = torso.at(q_goal);
    if (torso.at(q).angularDistance(goal) > 0.5 * std::numbers::pi) continue;
    torso.solve(goal, q);
    EXPECT_NEAR(torso.at(q).angularDistance(goal), 0.0, kSolved) << i;
    ++solved;
  }
  EXPECT_GT(solved, 300);
}

TEST(TorsoOrientation, MovesNothingButTheWaistAndKeepsItsLimits) {
  const TorsoOrientation torso(*g1());
  Random random(2, 1);
  const Eigen::VectorXd lower = g1()->lower(), upper = g1()->upper();
  for (int i = 0; i < 200; ++i) {
    const Eigen::VectorXd before = random_angles(random, 0.9);
    Eigen::VectorXd q = before;
    torso.solve(test::random_upright(random, 1.4), q);
    for (int j = 0; j < g1()->dof(); ++j) {
      const std::string& name = g1()->joints[static_cast<std::size_t>(j)].name;
      if (name.starts_with("waist"))
        EXPECT_TRUE(lower[j] <= q[j] && q[j] <= upper[j]) << name;
      else
        EXPECT_EQ(q[j], before[j]) << name;
    }
  }
}

TEST(TorsoOrientation, ComesAsNearAsTheLimitsAllow) {
  const TorsoOrientation torso(*g1());
  Eigen::VectorXd q = g1()->neutral;
  torso.solve(Eigen::Quaterniond(Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitY())), q);
  EXPECT_NEAR(q[joint("waist_pitch_joint")], g1()->joints[joint("waist_pitch_joint")].upper, 1e-12);
  EXPECT_NEAR(q[joint("waist_roll_joint")], 0.0, 1e-9);
  EXPECT_NEAR(q[joint("waist_yaw_joint")], 0.0, 1e-9);

  // No angle of the waist nearby is better, whichever goal is out of reach.
  Random random(3, 1);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Quaterniond goal = test::random_upright(random, 1.2);
    torso.solve(goal, q = g1()->neutral);
    const double best = torso.at(q).angularDistance(goal);
    for (int k = 0; k < 20; ++k) {
      Eigen::VectorXd other = q;
      for (const char* name : {"waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint"}) {
        const RobotJoint& limits = g1()->joints[static_cast<std::size_t>(joint(name))];
        other[joint(name)] = std::clamp(q[joint(name)] + random.uniform(-0.05, 0.05), limits.lower, limits.upper);
      }
      EXPECT_GE(torso.at(other).angularDistance(goal), best - 1e-6);
    }
  }
}

TEST(TorsoOrientation, OfARobotWithoutAWaistIsTheBase) {
  RobotModel robot = *g1();
  robot.roles.waist.clear();
  const TorsoOrientation torso(robot);
  Eigen::VectorXd q = Eigen::VectorXd::Constant(29, 0.2);
  EXPECT_EQ(torso.at(q).w(), 1.0);
  torso.solve(yaw_rotation(0.5), q);
  EXPECT_EQ(q, Eigen::VectorXd::Constant(29, 0.2));
}

// The waist of the T1 is below its trunk, which is the base: it turns the pelvis the other way.
TEST(TorsoOrientation, OfAWaistBelowTheBaseIsThatOfTheBaseInThePelvis) {
  const RobotModel& robot = *test::t1();
  const TorsoOrientation torso(robot);
  const int waist = robot.joint_index("Waist");
  Eigen::VectorXd q = robot.neutral;
  for (const double angle : {-1.2, -1e-9, 0.0, 0.4, 1.5}) {
    q[waist] = angle;
    EXPECT_NEAR(torso.at(q).angularDistance(pelvis_in_base(robot, q).R.conjugate()), 0.0, kSolved);
  }
}

TEST(TorsoOrientation, AWaistBelowTheBaseIsTurnedUnderIt) {
  const RobotModel& robot = *test::t1();
  const TorsoOrientation torso(robot);
  Eigen::VectorXd q = robot.neutral;
  torso.solve(yaw_rotation(0.6), q);
  EXPECT_NEAR(q[robot.joint_index("Waist")], -0.6, 1e-9);
  torso.solve(yaw_rotation(0.6) * Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()), q);  // which it cannot tilt
  EXPECT_NEAR(torso.at(q).angularDistance(yaw_rotation(0.6)), 0.0, 1e-6);
  Eigen::VectorXd rest = q - robot.neutral;
  rest[robot.joint_index("Waist")] = 0.0;
  EXPECT_EQ(rest.norm(), 0.0);
}

}  // namespace
}  // namespace duet
