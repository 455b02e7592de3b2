// The SIMD kernels against the double reference.
//
// With Adam's usual epsilon the first steps are +-rate times the sign of the gradient, so that rounding is amplified:
// moving the data of the double reference by 1e-7 m changes its own result by 1e-6 to 3e-4 of the objective. Agreement
// of the gradients is therefore tested with a large epsilon, where the descent is smooth, to rounding; that of the
// paper's schedule to what its own sensitivity allows.
#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <thread>

#include "duet/core/require.h"
#include "duet/retarget/solver/lane_problem.h"
#include "duet/retarget/solver/pair.h"
#include "duet/retarget/solver/pair_solver.h"
#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

std::vector<KernelKind> lane_kernels() {
  std::vector<KernelKind> kernels = available_kernels();
  kernels.pop_back();  // scalar
  return kernels;
}

PairSolution solve(const PairProblem& problem, PairOptions options, KernelKind kernel) {
  options.kernel = kernel;
  return solve_pair(problem, options);
}

double final_objective(const PairProblem& problem, const PairOptions& options, const PairSolution& solution) {
  const PairWeights weights = pair_iteration(options, pair_iterations(options) - 1).weights;
  return evaluate(problem, options, weights, solution.x).total(weights);
}

// Largest distance between the points of two solutions, the partner's keypoints included. [m]
double largest_shift(const PairProblem& problem, const PairVariables& a, const PairVariables& b) {
  const int dof = problem.chain.dof();
  const auto pose = [&](const PairVariables& x, int t) {
    ChainPose out;
    forward(problem.chain, root_rotation(problem.yaw[t], x.frames.col(t).segment<3>(dof)),
            problem.root.col(t) + x.offset + x.frames.col(t).tail<3>(), x.frames.col(t).head(dof), out);
    return out.points;
  };
  double shift = 0.0;
  for (int t = 0; t < problem.frames(); ++t) {
    shift = std::max(shift, (pose(a, t) - pose(b, t)).colwise().norm().maxCoeff());
    for (int h = 0; h < kHumanOffsets; ++h) {
      const int row = dof + 3 + 3 * h;
      shift = std::max(shift, (a.frames.col(t).segment<3>(row) - b.frames.col(t).segment<3>(row)).norm());
    }
  }
  return shift;
}

double relative_difference(double a, double b) { return std::abs(a - b) / std::abs(b); }

// Smooth descent: every option's gradient, to rounding. Floats carry 6e-8; 60 steps accumulate some tens of it, and
// w_temp's second differences lose two digits.
void expect_same_descent(const PairProblem& problem, PairOptions options, const std::string& what) {
  options.schedule.stage1_iterations = 40;
  options.schedule.stage1_rate = 0.05;
  options.schedule.stage2_iterations = 20;
  options.schedule.stage2_rate = 0.02;
  options.schedule.epsilon = 5.0 / problem.frames();  // gradients are of the order of 1 / T
  const PairSolution reference = solve(problem, options, KernelKind::kScalar);
  EXPECT_LT(reference.total[39], 0.98 * reference.total[0]) << what << ": the descent is too short to tell anything";
  for (const KernelKind kernel : lane_kernels()) {
    const PairSolution lanes = solve(problem, options, kernel);
    const std::string name = what + ", kernel " + std::string(to_string(kernel));
    EXPECT_EQ(lanes.kernel, kernel);
    EXPECT_LT(largest_shift(problem, lanes.x, reference.x), 2e-5) << name;
    ASSERT_EQ(lanes.terms.size(), reference.terms.size());
    for (std::size_t i = 0; i < lanes.terms.size(); ++i) {
      const PairTerms& a = lanes.terms[i];
      const PairTerms& b = reference.terms[i];
      const double scale = reference.total[i];
      EXPECT_NEAR(lanes.total[i], scale, 5e-6 * scale) << name << ", iteration " << i;
      EXPECT_NEAR(a.kin, b.kin, 1e-5 * b.kin) << name;
      EXPECT_NEAR(a.con, b.con, 1e-5 * b.con) << name;
      EXPECT_NEAR(a.hum, b.hum, 1e-4 * b.hum + 1e-9) << name;
      EXPECT_NEAR(a.temp, b.temp, 1e-4 * b.temp + 1e-9) << name;
      EXPECT_NEAR(a.pose, b.pose, 1e-4 * b.pose + 1e-9) << name;
    }
  }
}

TEST(PairKernel, SmoothDescentIsTheReferencesForAnyLength) {
  for (const int frames : {5, 6, 15, 16, 17, 31, 32, 33, 37, 250, 1007}) {
    const PairOptions options;
    expect_same_descent(make_pair_problem(test::random_clip(frames, frames), test::g1(), options), options,
                        "frames " + std::to_string(frames));
  }
}

TEST(PairKernel, SmoothDescentOnSlantedAxesFarFromTheOrigin) {
  InteractionClip clip = test::random_clip(37, 3);
  for (HumanMotion* person : {&clip.a, &clip.b}) {
    for (int t = 0; t < 37; ++t) person->joints.frame(t).colwise() += Eigen::Vector3d(300.0, -200.0, 0.0);
  }
  const PairOptions options;
  expect_same_descent(make_pair_problem(clip, test::slanted_robot(), options), options, "slanted");
}

// Sequences on the edge of a sign end further apart, so the usual one and the worst one are bounded.
TEST(PairKernel, PapersScheduleEndsWhereTheReferenceDoes) {
  const PairOptions options;
  for (const auto& [frames, seeds] : {std::pair{5, 9}, {37, 9}, {1007, 1}}) {
    std::map<KernelKind, std::vector<double>> differences;
    for (int seed = 1; seed <= seeds; ++seed) {
      const PairProblem problem = make_pair_problem(test::random_clip(frames, seed), test::g1(), options);
      const PairSolution reference = solve(problem, options, KernelKind::kScalar);
      const double expected = final_objective(problem, options, reference);
      for (const KernelKind kernel : lane_kernels()) {
        const PairSolution lanes = solve(problem, options, kernel);
        const double difference = relative_difference(final_objective(problem, options, lanes), expected);
        differences[kernel].push_back(difference);
        EXPECT_LT(difference, 1e-3) << frames << " frames, seed " << seed;
        EXPECT_LT(largest_shift(problem, lanes.x, reference.x), 5e-3) << frames << " frames, seed " << seed;
      }
    }
    for (auto& [kernel, all] : differences) {
      std::sort(all.begin(), all.end());
      EXPECT_LT(all[all.size() / 2], 1e-4) << frames << " frames, " << to_string(kernel);
    }
  }
}

TEST(PairKernel, EveryOptionAgreesWithTheReference) {
  const std::vector<std::pair<std::string, std::string>> changes = {
      {"kin-loss", "mean-norm"},   {"contact-reduction", "mean"}, {"contact-blocks", "cross-and-human"},
      {"contact-blocks", "cross"}, {"root", "per-frame"},         {"root", "fixed"},
      {"keypoints", "seven"},      {"keypoints", "eleven"},       {"adapt-human", "off"},
      {"keep-moments", "off"},     {"w-acceleration", "10"},      {"w-kin", "3"}};
  const InteractionClip clip = test::random_clip(37, 9);
  for (const auto& [name, value] : changes) {
    PairOptions options;
    set_pair_option(options, name, value);
    expect_same_descent(make_pair_problem(clip, test::g1(), options), options, name + "=" + value);
  }
  PairOptions options;
  options.adapt_human = false;
  options.root_translation = RootTranslation::kPerFrame;
  expect_same_descent(make_pair_problem(clip, test::g1(), options), options, "no human, root per frame");
}

TEST(PairKernel, Avx2AndAvx512GiveTheSameBits) {
  if (!kernel_runs_here(KernelKind::kV4)) GTEST_SKIP() << "not run: AVX-512 absent";
  for (const int frames : {5, 37, 1007}) {
    PairOptions options;
    if (frames == 37) options.root_translation = RootTranslation::kPerFrame;
    const PairProblem problem = make_pair_problem(test::random_clip(frames, 10), test::g1(), options);
    const PairSolution a = solve(problem, options, KernelKind::kV3);
    const PairSolution b = solve(problem, options, KernelKind::kV4);
    EXPECT_TRUE((a.x.frames.array() == b.x.frames.array()).all()) << frames;
    EXPECT_TRUE((a.x.offset.array() == b.x.offset.array()).all()) << frames;
    EXPECT_EQ(a.total, b.total) << frames;
  }
}

TEST(PairKernel, ThreadsDoNotChangeTheBits) {
  const PairOptions options;
  const PairProblem problem = make_pair_problem(test::random_clip(50, 11), test::g1(), options);
  const PairSolution expected = solve_pair(problem, options);
  std::array<PairSolution, 4> found;
  std::vector<std::jthread> threads;
  for (PairSolution& solution : found) threads.emplace_back([&] { solution = solve_pair(problem, options); });
  threads.clear();
  for (const PairSolution& solution : found) EXPECT_EQ(solution.x.frames, expected.x.frames);
}

TEST(PairKernel, VariablesThatAreHeldFixedStayZero) {
  PairOptions options;
  options.root_translation = RootTranslation::kFixed;
  options.adapt_human = false;
  const PairProblem problem = make_pair_problem(test::random_clip(20, 12), test::g1(), options);
  for (const KernelKind kernel : available_kernels()) {
    const PairVariables x = solve(problem, options, kernel).x;
    EXPECT_EQ(x.offset, Eigen::Vector3d::Zero());
    EXPECT_EQ(x.frames.bottomRows(3 + 3 * kHumanOffsets).cwiseAbs().maxCoeff(), 0.0);
    EXPECT_GT(x.frames.topRows(problem.chain.dof() + 3).cwiseAbs().maxCoeff(), 0.05);
  }
}

TEST(PairKernel, RobotTooLargeForLanesIsSolvedInDoubleOrRefusedByName) {
  RobotModel robot = test::g1();
  while (robot.dof() <= 48) {
    robot.links.push_back(robot.links.back());
    robot.joints.push_back(robot.joints.back());
  }
  robot.neutral = Eigen::VectorXd::Zero(robot.dof());
  PairOptions options;
  options.schedule = {.stage1_iterations = 1, .stage2_iterations = 0};
  const PairProblem problem = make_pair_problem(test::random_clip(5, 13), robot, options);
  EXPECT_EQ(solve_pair(problem, options).kernel, KernelKind::kScalar);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { solve(problem, options, KernelKind::kPortable); }));
}

// Without fused operations plain C++ is the narrowest x86 kernel, operation by operation.
TEST(PairKernel, PortableAndV2GiveTheSameBits) {
  if (!kernel_runs_here(KernelKind::kV2)) GTEST_SKIP() << "not run: x86-64 absent";
  for (const Optimizer optimizer : {Optimizer::kAdam, Optimizer::kLbfgs}) {
    PairOptions options;
    options.optimizer = optimizer;
    const PairProblem problem = make_pair_problem(test::random_clip(37, 15), test::g1(), options);
    const PairSolution a = solve(problem, options, KernelKind::kPortable);
    const PairSolution b = solve(problem, options, KernelKind::kV2);
    EXPECT_EQ(a.x.frames, b.x.frames);
    EXPECT_EQ(a.total, b.total);
  }
}

TEST(PairKernel, UnavailableKernelIsRefusedByName) {
  const PairOptions options;
  const PairProblem problem = make_pair_problem(test::random_clip(5, 14), test::g1(), options);
  for (const KernelKind kernel : {KernelKind::kV3, KernelKind::kV4}) {
    if (kernel_runs_here(kernel)) {
      PairOptions named;
      named.kernel = kernel;
      EXPECT_EQ(choose_kernel(problem, named), kernel);
      continue;
    }
    EXPECT_THAT(test::thrown_message<MissingError>([&] { solve(problem, options, kernel); }),
                HasSubstr("cannot run on this processor"));
  }
}

TEST(PairKernel, KernelsAreListedBestFirstAndScalarLast) {
  const std::vector<KernelKind> kernels = available_kernels();
  ASSERT_GE(kernels.size(), 2U);
  EXPECT_EQ(kernels.back(), KernelKind::kScalar);
  EXPECT_EQ(kernels[kernels.size() - 2], KernelKind::kPortable);
  for (std::size_t i = 0; i + 2 < kernels.size(); ++i) EXPECT_GT(kernels[i], kernels[i + 1]);
}

TEST(LibtorchPeer, AbsentPeerSaysHowToGetIt) {
  if (libtorch_available()) GTEST_SKIP() << "not run: libtorch is part of this build";
  EXPECT_SENTENCE(
      test::thrown_message<MissingError>([] { libtorch_frames_per_second(test::random_clip(5, 1), test::g1(), 1); }));
}

// Autograd knows nothing of our derivatives: equal descents mean equal objectives and equal gradients.
TEST(LibtorchPeer, AutogradDescendsOnTheSameObjective) {
  if (!libtorch_available()) GTEST_SKIP() << "not run: libtorch absent";
  PairOptions options;
  options.kernel = KernelKind::kScalar;
  const PairProblem problem = make_pair_problem(test::random_clip(60, 2), test::g1(), options);
  const std::vector<double> expected = solve_pair(problem, options).total;
  const std::vector<double> found = libtorch_objective(problem, 200);
  ASSERT_EQ(found.size(), expected.size());
  EXPECT_NEAR(found[0], expected[0], 1e-5 * expected[0]);
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-2 * expected[i]) << i;
  EXPECT_NEAR(found.back(), expected.back(), 1e-3 * expected.back());
}

TEST(LibtorchPeer, ReportsItsThroughput) {
  if (!libtorch_available()) GTEST_SKIP() << "not run: libtorch absent";
  EXPECT_GT(libtorch_frames_per_second(test::random_clip(50, 3), test::g1(), 2), 0.0);
}

}  // namespace
}  // namespace duet
