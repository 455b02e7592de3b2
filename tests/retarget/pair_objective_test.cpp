#include <gtest/gtest.h>

#include "duet/retarget/pair_problem.h"
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

}  // namespace
}  // namespace duet
