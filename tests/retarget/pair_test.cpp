#include "duet/retarget/solver/pair.h"

#include <ctime>
#include <limits>

#include "duet/core/require.h"
#include "duet/retarget/solver/pair_solver.h"
#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

std::string refusal(const InteractionClip& clip, const RobotModel& robot = test::g1(), const PairOptions& o = {}) {
  return test::thrown_message<std::invalid_argument>([&] { retarget(clip, robot, o); });
}

double mean_error(const RobotModel& robot, const PairedMotion& motion) {
  const PairChain chain = make_chain(robot, ContactKeypoints::kNine);
  double sum = 0.0;
  ChainPose pose;
  for (int t = 0; t < motion.frames(); ++t) {
    forward(chain, motion.robot.root[t].R.toRotationMatrix(), motion.robot.root[t].p, motion.robot.q.col(t), pose);
    for (int i = 0; i < kRetargetPairs; ++i) {
      sum += (pose.points.col(chain.pair_points[i]) - motion.reshaped.at(t, i)).norm();
    }
  }
  return sum / (kRetargetPairs * motion.frames());
}

TEST(Pair, RobotMotionIsValidAndWithinItsLimits) {
  const PairedMotion motion = retarget(test::random_clip(60, 1), test::g1());
  EXPECT_NO_THROW(validate(motion.robot, "robot"));
  ASSERT_EQ(motion.robot.joint_names.size(), 29U);
  EXPECT_EQ(motion.robot.joint_names[0], "left_hip_pitch_joint");
  EXPECT_EQ(motion.robot.rate_hz, 50.0);
  EXPECT_EQ(motion.frames(), 60);
  EXPECT_EQ(motion.reshaped.frames(), 60);
  EXPECT_EQ(motion.reshaped.points(), kRetargetPairs);
  for (int j = 0; j < 29; ++j) {
    EXPECT_GE(motion.robot.q.row(j).minCoeff(), test::g1().joints[j].lower);
    EXPECT_LE(motion.robot.q.row(j).maxCoeff(), test::g1().joints[j].upper);
  }
  for (int t = 0; t < motion.frames(); ++t) {
    EXPECT_NEAR(motion.robot.root[t].R.norm(), 1.0, 1e-12);
    EXPECT_GT(motion.robot.root[t].R.dot(motion.robot.root[std::max(t - 1, 0)].R), 0.9) << t;
  }
  EXPECT_NO_THROW(validate(motion.partner, "partner"));
}

TEST(Pair, ImitationAloneFollowsTheReshapedPerson) {
  PairOptions options;
  options.weights.con = 0.0;
  options.root_translation = RootTranslation::kPerFrame;
  options.schedule.stage1_iterations = 400;
  // Reachable up to the person's ball joints against the robot's hinges: a few centimetres over 16 joints.
  EXPECT_LT(mean_error(test::g1(), retarget(test::random_clip(40, 2), test::g1(), options)), 0.05);
}

TEST(Pair, ContactTermBringsDistancesBack) {
  const InteractionClip clip = test::random_clip(60, 3);
  PairOptions without;
  without.weights.con = 0.0;
  const double before = retarget(clip, test::g1(), without).loss.at("con").back();
  const double after = retarget(clip, test::g1()).loss.at("con").back();
  EXPECT_LT(after, 0.85 * before);  // a robot of 1.3 m cannot restore the distances within a person
  PairOptions cross;
  cross.contact_blocks = ContactBlocks::kCross;
  without.contact_blocks = ContactBlocks::kCross;
  const double cross_before = retarget(clip, test::g1(), without).loss.at("con").back();
  EXPECT_LT(retarget(clip, test::g1(), cross).loss.at("con").back(), 0.2 * cross_before);
}

TEST(Pair, LossCurvesAreOfEveryIterationAndFall) {
  PairOptions options;
  options.schedule.stage2_contact_scale = 1.0;
  const PairedMotion motion = retarget(test::random_clip(60, 4), test::g1(), options);
  for (const char* term : {"total", "kin", "con", "hum", "temp", "pose"}) {
    ASSERT_EQ(motion.loss.at(term).size(), 200U) << term;
  }
  const auto& total = motion.loss.at("total");
  EXPECT_LT(total.back(), 0.7 * total.front());
  for (std::size_t i = 0; i < total.size(); ++i) {
    const auto at = [&](const char* term) { return motion.loss.at(term)[i]; };
    const double sum = at("kin") + 0.25 * at("con") + 0.25 * at("hum") + 5.0 * at("temp") + 0.02 * at("pose");
    EXPECT_NEAR(total[i], sum, 1e-12);
  }
  EXPECT_EQ(motion.loss.at("hum").front(), 0.0);  // each value is that of the start of its iteration
}

TEST(Pair, RobotReplacesTheReactorWhoeverThatIs) {
  InteractionClip clip = test::random_clip(30, 5);
  const PairedMotion b = retarget(clip, test::g1());
  clip.reactor = Person::kA;
  const PairedMotion a = retarget(clip, test::g1());
  EXPECT_EQ(b.reactor, Person::kB);
  EXPECT_EQ(a.reactor, Person::kA);
  EXPECT_EQ(b.source_reactor.joints, clip.b.joints);
  EXPECT_EQ(b.source_partner.joints, clip.a.joints);
  EXPECT_EQ(a.source_reactor.joints, clip.a.joints);
  EXPECT_LT((b.robot.root[0].p - Eigen::Vector3d(0.9, 0.05, 0.7)).norm(), 0.4);
  EXPECT_LT((a.robot.root[0].p - Eigen::Vector3d(0.0, 0.05, 0.7)).norm(), 0.4);

  // Exchanging the names of the two persons and the role changes nothing.
  std::swap(clip.a, clip.b);
  const PairedMotion swapped = retarget(clip, test::g1());
  clip.reactor = Person::kB;
  EXPECT_NE(swapped.robot.q, a.robot.q);
  EXPECT_EQ(retarget(clip, test::g1()).robot.q, a.robot.q);
  EXPECT_EQ(swapped.robot.q, b.robot.q);
}

TEST(Pair, PartnerMovesOnlyArmsAndHandsFollowWrists) {
  const PairedMotion motion = retarget(test::random_clip(30, 6), test::g1());
  double moved = 0.0;
  for (int t = 0; t < motion.frames(); ++t) {
    const auto shift = [&](int j) -> Eigen::Vector3d {
      return motion.partner.joints.at(t, j) - motion.source_partner.joints.at(t, j);
    };
    for (int j = 0; j < kLeftShoulder; ++j) EXPECT_EQ(shift(j).norm(), 0.0);
    for (int j = kLeftShoulder; j <= kRightWrist; ++j) moved = std::max(moved, shift(j).norm());
    EXPECT_LT((shift(kLeftHand) - shift(kLeftWrist)).norm(), 1e-12);
    EXPECT_LT((shift(kRightHand) - shift(kRightWrist)).norm(), 1e-12);
  }
  EXPECT_GT(moved, 0.01);
  EXPECT_LT(moved, 0.5);
}

// Mean error of the distances between the robot's keypoints and those of `partner` against the two people's.
double distance_error(const PairedMotion& motion, const HumanMotion& partner) {
  const PairChain chain = make_chain(test::g1(), ContactKeypoints::kNine);
  ChainPose pose;
  double sum = 0.0;
  for (int t = 0; t < motion.frames(); ++t) {
    forward(chain, motion.robot.root[t].R.toRotationMatrix(), motion.robot.root[t].p, motion.robot.q.col(t), pose);
    for (int i = 0; i < chain.keys(); ++i)
      for (int j = 0; j < chain.keys(); ++j) {
        const double asked = (motion.source_reactor.joints.at(t, chain.key_smpl[i]) -
                              motion.source_partner.joints.at(t, chain.key_smpl[j]))
                                 .norm();
        const double found = (pose.points.col(chain.key_points[i]) - partner.joints.at(t, chain.key_smpl[j])).norm();
        sum += std::abs(found - asked);
      }
  }
  return sum / (motion.frames() * chain.keys() * chain.keys());
}

TEST(Pair, AnAdaptedPartnerKeepsTheDistancesBetterThanTheSource) {
  PairOptions options;
  options.contact_blocks = ContactBlocks::kCross;
  options.weights.con = 2.0;
  options.weights.hum = 0.05;
  const PairedMotion motion = retarget(test::random_clip(60, 3), test::g1(), options);
  EXPECT_LT(distance_error(motion, motion.partner), 0.9 * distance_error(motion, motion.source_partner));
}

TEST(Pair, PartnersRotationsFollowItsBones) {
  const PairedMotion motion = retarget(test::random_clip(30, 7), test::g1());
  const auto bone = [](const HumanMotion& m, int t, int joint, int child) -> Eigen::Vector3d {
    const Eigen::Vector3d d = m.joints.at(t, child) - m.joints.at(t, joint);
    return m.rotations[t * kSmplJoints + joint].conjugate() * d.normalized();
  };
  for (int t = 0; t < 30; t += 7) {
    for (const auto& [joint, child] : {std::pair<int, int>{kLeftShoulder, kLeftElbow}, {kRightElbow, kRightWrist}}) {
      const Eigen::Vector3d before = bone(motion.source_partner, t, joint, child);
      EXPECT_LT((bone(motion.partner, t, joint, child) - before).norm(), 1e-9);
    }
  }
}

TEST(Pair, FixedHumanStaysAsHeWas) {
  PairOptions options;
  options.adapt_human = false;
  const PairedMotion motion = retarget(test::random_clip(20, 8), test::g1(), options);
  EXPECT_EQ(motion.partner.joints, motion.source_partner.joints);
  EXPECT_EQ(motion.loss.at("hum").back(), 0.0);
}

TEST(Pair, RootTranslationReadings) {
  const InteractionClip clip = test::random_clip(20, 9);
  const auto offsets = [&](RootTranslation mode) {
    PairOptions options;
    options.root_translation = mode;
    const PairedMotion motion = retarget(clip, test::g1(), options);
    Eigen::Matrix3Xd out(3, motion.frames());
    for (int t = 0; t < motion.frames(); ++t) out.col(t) = motion.robot.root[t].p - motion.reshaped.at(t, 0);
    return out;
  };
  EXPECT_EQ(offsets(RootTranslation::kFixed).norm(), 0.0);
  const Eigen::Matrix3Xd constant = offsets(RootTranslation::kConstantOffset);
  EXPECT_GT(constant.col(0).norm(), 1e-3);
  EXPECT_LT((constant.colwise() - constant.col(0)).norm(), 1e-12);
  const Eigen::Matrix3Xd free = offsets(RootTranslation::kPerFrame);
  EXPECT_GT((free.colwise() - free.col(0)).norm(), 1e-2);
}

TEST(Pair, FilterSmoothsTheJointsOnly) {
  const InteractionClip clip = test::random_clip(40, 10);
  PairOptions options;
  options.filter = false;
  const PairedMotion raw = retarget(clip, test::g1(), options);
  const PairedMotion smooth = retarget(clip, test::g1());
  const auto bends = [](const Eigen::MatrixXd& q) {
    // Away from the ends, where repeating the last frame makes a kink.
    return (q.middleCols(4, 32) - 2.0 * q.middleCols(3, 32) + q.middleCols(2, 32)).norm();
  };
  EXPECT_LT(bends(smooth.robot.q), bends(raw.robot.q));
  for (int t = 0; t < 40; ++t) EXPECT_EQ(raw.robot.root[t].p, smooth.robot.root[t].p);
}

TEST(Pair, OtherRatesAreResampledTo50Hz) {
  InteractionClip clip = test::random_clip(121, 11, 120.0);
  clip.phases = {24, 96};
  const PairedMotion motion = retarget(clip, test::g1());
  EXPECT_EQ(motion.frames(), 51);  // 1 s, both ends
  EXPECT_EQ(motion.phases, (Phases{10, 40}));
  EXPECT_EQ(motion.source_reactor.rate_hz, 50.0);
  EXPECT_LT((motion.source_reactor.joints.at(50, kHead) - clip.b.joints.at(120, kHead)).norm(), 1e-9);
  EXPECT_EQ(motion.settings.at("source-rate-hz"), "120");
}

TEST(Pair, SettingsNameEveryOptionAndTheKernelUsed) {
  PairOptions options;
  options.schedule = {.stage1_iterations = 2, .stage2_iterations = 1};
  const PairedMotion motion = retarget(test::random_clip(8, 12), test::g1(), options);
  for (const std::string& name : pair_option_names()) {
    EXPECT_EQ(motion.settings.at(name), pair_option(options, name)) << name;
  }
  EXPECT_EQ(motion.settings.at("kernel-used"), to_string(available_kernels().front()));
  EXPECT_EQ(motion.settings.at("robot"), "g1");
  EXPECT_EQ(motion.loss.at("total").size(), 3U);
}

TEST(Pair, ShortestSequenceIsFiveFrames) {
  EXPECT_NO_THROW(retarget(test::random_clip(5, 13), test::g1()));
  InteractionClip clip = test::random_clip(4, 13);
  EXPECT_SENTENCE(refusal(clip));
  clip = test::random_clip(9, 13, 120.0);  // 9 frames of 1/120 s are 4 of 1/50 s
  EXPECT_SENTENCE(refusal(clip));
}

TEST(Pair, RefusesBadClipsRobotsAndOptions) {
  InteractionClip clip = test::random_clip(10, 14);
  clip.b.joints.at(3, kHead).x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_SENTENCE(refusal(clip));

  clip = test::random_clip(10, 14);
  clip.a = slice(clip.a, 0, 9);
  EXPECT_NE(refusal(clip), "(nothing was thrown)");

  clip = test::random_clip(10, 14);
  RobotModel robot = test::g1();
  robot.pairs.clear();
  EXPECT_SENTENCE(refusal(clip, robot));

  PairOptions options;
  options.weights.kin = -1.0;
  EXPECT_SENTENCE(refusal(clip, test::g1(), options));

  options = {};
  options.smpl_path = "/nonexistent/basis.npz";
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { retarget(clip, test::g1(), options); }));
}

TEST(PairTiming, CountsFramesAndNamesTheKernel) {
  PairOptions options;
  options.schedule = {.stage1_iterations = 1, .stage2_iterations = 1};
  const PairTiming timing = time_pair(test::random_clip(25, 15, 100.0), test::g1(), options, 2);
  EXPECT_EQ(timing.frames, 13);
  EXPECT_EQ(timing.kernel, available_kernels().front());
  EXPECT_GT(timing.solver, 0.0);
  EXPECT_GT(timing.whole, 0.0);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(
      [&] { time_pair(test::random_clip(25, 15), test::g1(), options, 0); }));
}

// Frames a second are of the fastest round: all rounds together took no less than that many times it.
TEST(PairTiming, IsNoLongerThanWhatTheThreadSpent) {
  const auto spent = [] {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  };
  PairOptions options;
  options.schedule = {.stage1_iterations = 1, .stage2_iterations = 1};
  const double begin = spent();
  const PairTiming timing = time_pair(test::random_clip(25, 15, 100.0), test::g1(), options, 3);
  EXPECT_LE(3 * timing.frames * (1.0 / timing.solver + 1.0 / timing.whole), spent() - begin);
}

// The base of the T1 is its trunk: it starts where the pelvis below it is on the person's.
TEST(Pair, StartsWithThePelvisOnThePersonsWhereverTheBaseIs) {
  const auto t1 = load_shared_robot("t1");
  const InteractionClip clip = test::random_clip(20, 1);
  const PairProblem problem = make_pair_problem(clip, *t1, {});
  const PairProblem of_g1 = make_pair_problem(clip, test::g1(), {});
  ChainPose pose;
  for (int t = 0; t < problem.frames(); ++t) {
    const Eigen::Matrix3d R_WB = yaw_rotation(problem.yaw[t]).toRotationMatrix();
    forward(problem.chain, R_WB, problem.root.col(t), t1->neutral, pose);
    const Eigen::Vector3d target = problem.targets.at(t, 0);
    EXPECT_LT((pose.points.col(problem.chain.pair_points[0]) - target).norm(), 1e-12);
    EXPECT_EQ(of_g1.root.col(t), of_g1.targets.at(t, 0));
  }
}

TEST(Pair, ARobotWhoseBaseIsItsTrunkIsRetargeted) {
  const auto t1 = load_shared_robot("t1");
  const PairedMotion motion = retarget(test::random_clip(60, 1), *t1);
  EXPECT_EQ(motion.robot.joint_names, t1->joint_names());
  for (int j = 0; j < t1->dof(); ++j) {
    EXPECT_GE(motion.robot.q.row(j).minCoeff(), t1->joints[j].lower);
    EXPECT_LE(motion.robot.q.row(j).maxCoeff(), t1->joints[j].upper);
  }
}

}  // namespace
}  // namespace duet
