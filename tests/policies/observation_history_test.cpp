#include "duet/policies/policy.h"
#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

ObservationFrame numbered(double number) {
  ObservationFrame frame;
  frame.partner.setConstant(number);
  frame.robot.q = frame.robot.v = Eigen::VectorXd::Constant(29, number);
  return frame;
}

TEST(ObservationHistory, RepeatsTheFirstFrameUntilThereAreEnough) {
  ObservationHistory history;
  for (int tick = 0; tick < 30; ++tick) {
    history.add(numbered(tick));
    const Observation observation = history.at(tick);
    ASSERT_EQ(observation.history.size(), 12u);
    EXPECT_EQ(observation.tick, tick);
    EXPECT_EQ(observation.now().robot.q[0], tick);
    for (int i = 0; i < 12; ++i)
      EXPECT_EQ(observation.history[static_cast<std::size_t>(i)].partner(0, 0), std::max(0, tick - 11 + i));
  }
}

TEST(ObservationHistory, ForgetsOnReset) {
  ObservationHistory history;
  history.add(numbered(1));
  history.reset();
  history.add(numbered(2));
  EXPECT_EQ(history.at(0).history.front().partner(0, 0), 2.0);
}

TEST(ObservationHistory, RefusesToBeAskedBeforeTheFirstFrame) {
  const ObservationHistory history;
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)history.at(0); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { to_matrix({}, {}); }));
}

TEST(ObservationHistory, BecomesOneColumnPerFrame) {
  ObservationHistory history;
  for (int tick = 0; tick < 20; ++tick) history.add(numbered(tick));
  const Eigen::Vector3d start(1, 2, 3);
  const Eigen::MatrixXd matrix = to_matrix(history.at(19), start);
  ASSERT_EQ(matrix.rows(), kObservationSize);
  ASSERT_EQ(matrix.cols(), kHistoryFrames);
  for (int i = 0; i < kHistoryFrames; ++i) EXPECT_EQ(matrix.col(i), to_vector(numbered(8 + i), start));
}

}  // namespace
}  // namespace duet
