
#include "duet/core/require.h"
#include "duet/retarget/solver/pair_solver.h"
#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

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
