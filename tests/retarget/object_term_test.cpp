// Carried objects and weighted keypoints in PAIR: closed form, slope, the SIMD kernels against the double reference,
// and what retargeting gains by them.
#include <gmock/gmock.h>

#include <cmath>

#include "duet/retarget/pair_terms.h"
#include "duet/retarget/solver/pair.h"
#include "duet/retarget/solver/pair_solver.h"
#include "duet/robots/kinematics.h"
#include "tests/retarget/fixtures.h"

namespace duet {
namespace {

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
