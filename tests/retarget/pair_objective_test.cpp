#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "duet/retarget/pair_problem.h"
#include "duet/retarget/pair_terms.h"
#include "duet/retarget/solver/lbfgs.h"
#include "duet/retarget/solver/pair.h"
#include "duet/retarget/solver/pair_solver.h"
#include "duet/robots/kinematics.h"
#include "tests/retarget/fixtures.h"

namespace duet {
namespace {

PairVariables random_variables(const PairProblem& problem, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-0.4, 0.4);
  PairVariables x = PairVariables::zero(problem.chain.dof(), problem.frames());
  for (double& value : x.frames.reshaped()) value = uniform(engine);
  for (double& value : x.offset) value = uniform(engine);
  return x;
}

// Holds at zero what the options hold fixed.
void clear_fixed(const PairProblem& problem, const PairOptions& options, PairVariables& x) {
  if (options.root_translation != RootTranslation::kConstantOffset) x.offset.setZero();
  if (options.root_translation != RootTranslation::kPerFrame) x.frames.bottomRows(3).setZero();
  if (!options.adapt_human) x.frames.middleRows(problem.chain.dof() + 3, 3 * kHumanOffsets).setZero();
}

double objective(const PairProblem& problem, const PairOptions& options, const PairVariables& x) {
  return evaluate(problem, options, options.weights, x).total(options.weights);
}

PairVariables moved(const PairVariables& x, const PairVariables& direction, double h) {
  return {x.frames + h * direction.frames, x.offset + h * direction.offset};
}

// Central differences: error O(h^2 f''') + O(eps f / h), both near 1e-9 for h = 1e-5 and f of a few units.
constexpr double kStep = 1e-5;
constexpr double kTolerance = 3e-8;

double slope(const PairProblem& problem, const PairOptions& options, const PairVariables& x, const PairVariables& d) {
  return (objective(problem, options, moved(x, d, kStep)) - objective(problem, options, moved(x, d, -kStep))) /
         (2.0 * kStep);
}

void check_directions(const PairProblem& problem, const PairOptions& options, const std::string& what) {
  PairVariables x = random_variables(problem, 5);
  clear_fixed(problem, options, x);
  PairVariables gradient;
  evaluate(problem, options, options.weights, x, &gradient);
  for (const unsigned seed : {11U, 12U}) {
    PairVariables d = random_variables(problem, seed);
    clear_fixed(problem, options, d);
    const double analytic = gradient.frames.cwiseProduct(d.frames).sum() + gradient.offset.dot(d.offset);
    EXPECT_NEAR(analytic, slope(problem, options, x, d), kTolerance * (1.0 + std::abs(analytic))) << what;
  }
}

TEST(PairObjective, GradientIsTheSlopeForEveryCombinationOfOptions) {
  const InteractionClip clip = test::random_clip(6, 1);
  for (const auto keypoints : {ContactKeypoints::kNine, ContactKeypoints::kEleven, ContactKeypoints::kSeven}) {
    PairOptions options;
    options.keypoints = keypoints;
    const PairProblem problem = make_pair_problem(clip, test::g1(), options);
    for (int code = 0; code < 2 * 2 * 3 * 3 * 2; ++code) {
      options.kin_loss = static_cast<KinLoss>(code % 2);
      options.contact_reduction = static_cast<ContactReduction>(code / 2 % 2);
      options.contact_blocks = static_cast<ContactBlocks>(code / 4 % 3);
      options.root_translation = static_cast<RootTranslation>(code / 12 % 3);
      options.adapt_human = code / 36 % 2 == 0;
      options.weights.acceleration = 0.5 + code % 3;
      check_directions(problem, options, "combination " + std::to_string(code));
    }
  }
}

TEST(PairObjective, GradientOfEveryVariableOnSlantedAxes) {
  PairOptions options;
  options.root_translation = RootTranslation::kPerFrame;
  const PairProblem problem = make_pair_problem(test::random_clip(5, 2), test::slanted_robot(), options);
  const PairVariables x = random_variables(problem, 6);
  PairVariables gradient;
  evaluate(problem, options, options.weights, x, &gradient);
  for (const int t : {0, 2, 4}) {
    for (int row = 0; row < x.frames.rows(); ++row) {
      PairVariables d = PairVariables::zero(problem.chain.dof(), problem.frames());
      d.frames(row, t) = 1.0;
      EXPECT_NEAR(gradient.frames(row, t), slope(problem, options, x, d), kTolerance) << "row " << row;
    }
  }
}

TEST(PairObjective, GradientHoldsNearZeroAndLargeRootRotations) {
  const PairOptions options;
  const PairProblem problem = make_pair_problem(test::random_clip(5, 3), test::g1(), options);
  for (const double angle : {0.0, 1e-9, 1e-5, 1.1e-4, 3.1, 6.2}) {
    PairVariables x = random_variables(problem, 7);
    x.frames.bottomRows(3).setZero();
    const int first = problem.chain.dof();
    x.frames.middleRows(first, 3).colwise() = Eigen::Vector3d(angle * Eigen::Vector3d(2, -1, 2) / 3.0);
    PairVariables gradient;
    evaluate(problem, options, options.weights, x, &gradient);
    for (int r = 0; r < 3; ++r) {
      PairVariables d = PairVariables::zero(first, problem.frames());
      d.frames(first + r, 1) = 1.0;
      EXPECT_NEAR(gradient.frames(first + r, 1), slope(problem, options, x, d), kTolerance) << "angle " << angle;
    }
  }
}

TEST(PairObjective, TermsHaveTheirClosedForms) {
  PairOptions options;
  PairProblem problem = make_pair_problem(test::random_clip(5, 4), test::g1(), options);
  const int dof = problem.chain.dof();
  PairVariables x = PairVariables::zero(dof, 5);

  // q quadratic in time: v_t = (2 t + 1) c, a = 2 c.
  for (int t = 0; t < 5; ++t) x.frames(3, t) = 0.01 * t * t;
  PairTerms terms = evaluate(problem, options, options.weights, x);
  EXPECT_NEAR(terms.temp, 1e-4 * ((1.0 + 9.0 + 25.0 + 49.0) / 4.0 + 4.0), 1e-16);
  EXPECT_NEAR(terms.pose, 1e-4 * (1.0 + 16.0 + 81.0 + 256.0) / (5.0 * dof), 1e-16);
  options.weights.acceleration = 3.0;
  EXPECT_NEAR(evaluate(problem, options, options.weights, x).temp, 1e-4 * (84.0 / 4.0 + 12.0), 1e-16);

  x = PairVariables::zero(dof, 5);
  x.frames(dof + 3 + 4, 2) = 0.3;  // the right shoulder's y
  EXPECT_NEAR(evaluate(problem, options, options.weights, x).hum, 0.09 / 5.0, 1e-15);

  // Targets on the robot's points: no kinematic error; all moved by (0.3, 0, 0.4): 16 * 0.25, or 0.5 on average.
  ChainPose pose;
  for (int t = 0; t < 5; ++t) {
    forward(problem.chain, root_rotation(problem.yaw[t], Eigen::Vector3d::Zero()), problem.root.col(t),
            Eigen::VectorXd::Zero(dof), pose);
    for (int i = 0; i < kRetargetPairs; ++i) problem.targets.at(t, i) = pose.points.col(problem.chain.pair_points[i]);
  }
  x = PairVariables::zero(dof, 5);
  EXPECT_LT(evaluate(problem, options, options.weights, x).kin, 1e-25);
  x.offset = {0.3, 0.0, 0.4};
  EXPECT_NEAR(evaluate(problem, options, options.weights, x).kin, 4.0, 1e-12);
  options.kin_loss = KinLoss::kMeanNorm;
  EXPECT_NEAR(evaluate(problem, options, options.weights, x).kin, 0.5, 1e-11);  // the guard adds 1e-12
}

TEST(PairObjective, ContactTermCountsBothTrianglesOfTheChosenBlocks) {
  PairOptions options;
  PairProblem problem = make_pair_problem(test::random_clip(5, 5), test::g1(), options);
  const PairVariables x = PairVariables::zero(problem.chain.dof(), 5);
  const auto con = [&](ContactBlocks blocks, ContactReduction reduction) {
    options.contact_blocks = blocks;
    options.contact_reduction = reduction;
    return evaluate(problem, options, options.weights, x).con;
  };
  // Direct sum over the printed matrix.
  double full = 0.0;
  double robot = 0.0;
  for (int t = 0; t < 5; ++t) {
    ChainPose pose;
    forward(problem.chain, root_rotation(problem.yaw[t], Eigen::Vector3d::Zero()), problem.root.col(t),
            Eigen::VectorXd::Zero(problem.chain.dof()), pose);
    Eigen::Matrix3Xd keys(3, 18);
    for (int k = 0; k < 9; ++k) keys.col(k) = pose.points.col(problem.chain.key_points[k]);
    keys.rightCols(9) = problem.human.frame(t);
    const Eigen::Matrix3Xd before = [&] {
      const InteractionClip clip = test::random_clip(5, 5);
      Eigen::Matrix3Xd m(3, 18);
      m << clip.b.joints.select(problem.chain.key_smpl).frame(t), clip.a.joints.select(problem.chain.key_smpl).frame(t);
      return m;
    }();
    for (int i = 0; i < 18; ++i) {
      for (int j = 0; j < 18; ++j) {
        const double e = (keys.col(i) - keys.col(j)).norm() - (before.col(i) - before.col(j)).norm();
        full += e * e / 5.0;
        if (i < 9 && j < 9) robot += e * e / 5.0;
      }
    }
  }
  EXPECT_NEAR(con(ContactBlocks::kFull, ContactReduction::kFrobenius), full, 1e-9);
  EXPECT_NEAR(con(ContactBlocks::kFull, ContactReduction::kMean), full / 324.0, 1e-11);
  EXPECT_NEAR(con(ContactBlocks::kCrossAndHuman, ContactReduction::kFrobenius), full - robot, 1e-9);
  // The partner has not moved: its own block adds nothing yet.
  EXPECT_NEAR(con(ContactBlocks::kCross, ContactReduction::kFrobenius), full - robot, 1e-9);
}

// L D L^T has on its diagonals D (1 + f^2 + s^2), D (f + f s) and D s.
TEST(TemporalFactor, ItsProductIsTheFiveBands) {
  for (const double stiffness : {0.01, 1.0, 50.0})
    for (const double velocity : {0.0, 3.0})
      for (const double acceleration : {0.0, 0.5, 40.0}) {
        const auto [first, second, scale] = temporal_factor(stiffness, velocity, acceleration);
        const double D = scale * scale, size = stiffness + 2.0 * velocity + 6.0 * acceleration;
        EXPECT_NEAR(D * (1.0 + first * first + second * second), size, 1e-6 * size);
        EXPECT_NEAR(D * (first + first * second), -velocity - 4.0 * acceleration, 1e-6 * size);
        EXPECT_NEAR(D * second, acceleration, 1e-6 * size);
      }
}

// Carried objects and weighted keypoints in PAIR: closed form, slope, the SIMD kernels against the double reference,
// and what retargeting gains by them.

// Two people who hold a box between their right hands.
InteractionClip carrying(int frames, unsigned seed) {
  InteractionClip clip = test::random_clip(frames, seed);
  clip.object.keypoints.resize(3, 4);
  clip.object.keypoints << 0.2, -0.2, 0.0, 0.0, 0.1, 0.1, -0.2, 0.0, 0.0, 0.1, 0.1, -0.2;
  for (int t = 0; t < frames; ++t)
    clip.object.poses.push_back(
        {.R = yaw_rotation(0.02 * t), .p = 0.5 * (clip.a.joints.at(t, kRightHand) + clip.b.joints.at(t, kRightHand))});
  return clip;
}

PairOptions with(const std::vector<std::pair<std::string, std::string>>& choices) { return make_pair_options(choices); }

const std::vector<std::vector<std::pair<std::string, std::string>>> kVariants = {
    {},
    {{"mode", "grounded"}},
    {{"adapt-human", "off"}},
    {{"contact-blocks", "cross"}, {"contact-reduction", "mean"}},
    {{"w-object", "3"}, {"keypoint-list", "head:0.5:1,left_hand:2,right_hand:1:0.5,left_elbow:0"}},
    {{"mode", "best"}, {"keypoint-list", "left_wrist:2,right_wrist,head"}}};

PairVariables drawn(const PairProblem& problem, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-0.4, 0.4);
  PairVariables x = PairVariables::zero(problem.chain.dof(), problem.frames());
  for (double& value : x.frames.reshaped()) value = uniform(engine);
  x.frames.bottomRows(3).setZero();
  if (problem.upright) x.frames.middleRows(problem.chain.dof(), 3).setZero();
  return x;
}

TEST(ObjectTerm, GradientIsTheSlope) {
  for (const auto& choices : kVariants) {
    PairOptions options = with(choices);
    options.weights.collision = 0.0;  // its slope jumps where spheres begin to touch
    const PairProblem problem = make_pair_problem(carrying(6, 1), test::g1(), options);
    ASSERT_EQ(problem.object.count(), 4);
    PairVariables x = drawn(problem, 5), d = drawn(problem, 11);
    for (PairVariables* v : {&x, &d})
      if (!options.adapt_human) v->frames.middleRows(problem.chain.dof() + 3, 3 * kHumanOffsets).setZero();
    PairVariables gradient;
    evaluate(problem, options, options.weights, x, &gradient);
    const auto total = [&](double h) {
      return evaluate(problem, options, options.weights, {x.frames + h * d.frames, x.offset}).total(options.weights);
    };
    constexpr double kStep = 1e-5;  // error O(h^2 f''') + O(eps f / h)
    const double slope = (total(kStep) - total(-kStep)) / (2.0 * kStep);
    EXPECT_NEAR(gradient.frames.cwiseProduct(d.frames).sum(), slope, 1e-7 * (1.0 + std::abs(slope)));
  }
}

TEST(ObjectTerm, IsTheSumOverBothTrianglesOfKeypointsAndPoints) {
  const PairOptions options = with({{"keypoint-list", "head:1:2,left_hand,right_hand:1:0"}});
  const InteractionClip clip = carrying(5, 2);
  const PairProblem problem = make_pair_problem(clip, test::g1(), options);
  const PairVariables x = PairVariables::zero(problem.chain.dof(), 5);
  const PointTracks object = keypoint_tracks(clip.object);
  double expected = 0.0;
  for (int t = 0; t < 5; ++t) {
    ChainPose pose;
    forward(problem.chain, root_rotation(problem.yaw[t], Eigen::Vector3d::Zero()), problem.root.col(t),
            Eigen::VectorXd::Zero(problem.chain.dof()), pose);
    for (const auto& [key, smpl, weight] : {std::tuple{0, kHead, 2.0}, {1, kLeftHand, 1.0}}) {
      for (int o = 0; o < 4; ++o) {
        const double after = (pose.points.col(problem.chain.key_points[key]) - object.at(t, o)).norm();
        const double before = (clip.b.joints.at(t, smpl) - object.at(t, o)).norm();
        expected += 2.0 * weight * (after - before) * (after - before) / 5.0;
      }
    }
  }
  // The partner has not moved: his distances add nothing yet.
  EXPECT_NEAR(evaluate(problem, options, options.weights, x).object, expected, 1e-9);
  EXPECT_NEAR(PairTerms{.object = 2.0}.total({.con = 0.25, .object = 3.0}), 1.5, 1e-15);
}

TEST(ObjectTerm, LanesAgreeWithTheReferenceAndWithEachOther) {
  for (const auto& choices : kVariants) {
    PairOptions options = with(choices);
    options.optimizer = Optimizer::kAdam;
    options.schedule = {.stage1_iterations = 40, .stage1_rate = 0.05, .stage2_iterations = 20, .stage2_rate = 0.02};
    options.schedule.epsilon = 5.0 / 37.0;  // a smooth descent (pair_kernel_test.cpp)
    const PairProblem problem = make_pair_problem(carrying(37, 3), test::g1(), options);
    options.kernel = KernelKind::kScalar;
    const PairSolution reference = solve_pair(problem, options);
    EXPECT_GT(reference.terms.front().object, 0.0);
    PairSolution first;
    for (const KernelKind kernel : available_kernels()) {
      if (kernel == KernelKind::kScalar) continue;
      options.kernel = kernel;
      const PairSolution lanes = solve_pair(problem, options);
      for (std::size_t i = 0; i < lanes.terms.size(); ++i) {
        EXPECT_NEAR(lanes.total[i], reference.total[i], 1e-5 * reference.total[i]) << to_string(kernel) << " " << i;
        EXPECT_NEAR(lanes.terms[i].object, reference.terms[i].object, 1e-4 * reference.terms[i].object + 1e-9);
        EXPECT_NEAR(lanes.terms[i].con, reference.terms[i].con, 1e-4 * reference.terms[i].con + 1e-9);
      }
      if (kernel == KernelKind::kV4) first = lanes;
      if (kernel != KernelKind::kV3 || first.x.frames.size() == 0) continue;
      EXPECT_TRUE((first.x.frames.array() == lanes.x.frames.array()).all());  // AVX-512 and AVX2: the same bits
      EXPECT_EQ(first.total, lanes.total);
    }
  }
}

TEST(ObjectTerm, LbfgsGoesDownInLanesAndInDouble) {
  for (const KernelKind kernel : {KernelKind::kAuto, KernelKind::kScalar}) {
    PairOptions options = with({{"mode", "best"}, {"lbfgs-iterations", "20"}});
    options.kernel = kernel;
    const PairProblem problem = make_pair_problem(carrying(40, 6), test::g1(), options);
    const PairSolution solution = solve_pair(problem, options);
    const auto imitation = static_cast<std::size_t>(imitation_iterations(options));
    for (std::size_t i = 1; i < solution.total.size(); ++i)  // the weights change once
      if (i != imitation) {
        EXPECT_LE(solution.total[i], solution.total[i - 1]);
      }
    EXPECT_LT(solution.total.back(), 0.8 * solution.total[imitation]);
  }
}

TEST(ObjectTerm, AWeightOfZeroLeavesTheObjectOutToTheBit) {
  InteractionClip clip = carrying(30, 4);
  const PairedMotion without = retarget(clip, test::g1(), with({{"w-object", "0"}}));
  EXPECT_EQ(without.object.poses.size(), 30U);  // kept in the file all the same
  EXPECT_FALSE(without.loss.contains("object"));
  clip.object = {};
  const PairedMotion never = retarget(clip, test::g1(), {});
  EXPECT_EQ(without.robot.q, never.robot.q);
  EXPECT_EQ(without.partner.joints, never.partner.joints);
  EXPECT_TRUE(never.object.empty());
}

TEST(ObjectTerm, AListOfTheDefaultKeypointsChangesNoBit) {
  const InteractionClip clip = test::random_clip(30, 5);
  std::vector<ContactKeypoint> list;
  for (const int smpl : make_chain(test::g1(), ContactKeypoints::kNine).key_smpl) list.push_back({.smpl = smpl});
  PairOptions options;
  options.keypoint_list = list;
  EXPECT_EQ(retarget(clip, test::g1(), options).robot.q, retarget(clip, test::g1(), {}).robot.q);
}

TEST(ObjectTerm, TheRobotsHandsComeCloserToTheirDistances) {
  const InteractionClip clip = carrying(60, 7);
  const auto error = [&](const std::string& weight) {
    const PairedMotion motion = retarget(clip, test::g1(), with({{"w-object", weight}}));
    EXPECT_EQ(motion.loss.contains("object"), weight != "0");
    const int hand = test::g1().keypoints[test::g1().keypoint_index("right_hand")].frame;
    const PointTracks hands = frame_tracks(test::g1(), motion.robot, {hand});
    const PointTracks object = keypoint_tracks(motion.object);
    double sum = 0.0;
    for (int t = 0; t < 60; ++t)
      for (int o = 0; o < 4; ++o)
        sum += std::abs((hands.at(t, 0) - object.at(t, o)).norm() -
                        (clip.b.joints.at(t, kRightHand) - object.at(t, o)).norm());
    return sum / 240.0;
  };
  const double without = error("0"), with_it = error("1"), more = error("10");
  EXPECT_LT(with_it, without);
  EXPECT_LT(more, with_it);
}

TEST(ObjectTerm, AnotherRateTakesTheObjectAlong) {
  InteractionClip clip = carrying(20, 8);
  clip.a.rate_hz = clip.b.rate_hz = 25.0;
  const PairedMotion motion = retarget(clip, test::g1(), with({{"stage1-iterations", "2"}}));
  ASSERT_EQ(static_cast<int>(motion.object.poses.size()), motion.frames());
  EXPECT_LT((motion.object.poses[4].p - clip.object.poses[2].p).norm(), 1e-12);
}

}  // namespace
}  // namespace duet
