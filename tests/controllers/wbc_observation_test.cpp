// The inputs of WBC-Sim's networks, number by number.
#include <gtest/gtest.h>

#include "duet/controllers/wbc_sim/observation.h"
#include "duet/core/numbers.h"
#include "tests/controllers/standing.h"

namespace duet {
namespace {

using test::g1;
using test::standing_reference;

TEST(WbcLayout, SizesAreThePrintedTotals) {
  const WbcLayout layout(29);
  EXPECT_EQ(layout.oracle(), 163);
  EXPECT_EQ(layout.student(), 1090);
  EXPECT_EQ(layout.critic(22), 361);
  EXPECT_EQ(g1()->roles.bodies.size(), 22U);
  int sum = 0;
  for (const LayoutEntry& channel : layout.channels(WbcKind::kStudent)) sum += channel.size;
  EXPECT_EQ(sum, 1090);
}

TEST(WbcObservation, EveryChannelIsAtItsPlace) {
  WbcTracker tracker(g1());
  RobotState state = g1()->standing_state();
  state.q[3] += 0.5;
  state.v[4] = 2.0;
  state.w_WB_B = {1.0, 2.0, 3.0};
  state.v_WB = {4.0, 5.0, 6.0};
  Eigen::VectorXf action = Eigen::VectorXf::Zero(29);
  action[7] = 0.25F;
  tracker.reset(standing_reference(0.1, -0.2));
  WbcSensors sensors;
  read_sensors(state, tracker, sensors);
  std::vector<float> o(163);
  write_oracle(sensors, action, o);
  EXPECT_FLOAT_EQ(o[3], 0.5F);
  EXPECT_FLOAT_EQ(o[29 + 4], 2.0F);
  EXPECT_FLOAT_EQ(o[58 + 1], 2.0F);
  EXPECT_FLOAT_EQ(o[61 + 2], 6.0F);
  EXPECT_FLOAT_EQ(o[64 + 2], -1.0F);
  EXPECT_FLOAT_EQ(o[67 + 7], 0.25F);
  EXPECT_NEAR(o[154], 0.1F, 1e-6);
  EXPECT_NEAR(o[155], -0.2F, 1e-6);
  EXPECT_FLOAT_EQ(o[157], 1.0F);  // first column of the identity
  EXPECT_FLOAT_EQ(o[161], 1.0F);  // second column
}

TEST(WbcObservation, HistoryIsOldestFirstWithoutTheCurrentFrame) {
  WbcObserver observer(WbcKind::kStudent, 29);
  WbcTracker tracker(g1());
  tracker.reset(standing_reference());
  WbcSensors sensors;
  read_sensors(g1()->standing_state(), tracker, sensors);
  Eigen::VectorXf action = Eigen::VectorXf::Zero(29);
  const int at = 29 + 29 + 3 + 3, frame = 93, history = 93 + 67;
  action[0] = 7.0F;
  std::span<const float> shown = observer.update(sensors, action);
  ASSERT_EQ(shown.size(), 1090U);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(shown[history + i * frame + at], 7.0F) << "the first stands for all " << i;
  for (int i = 1; i <= 3; ++i) {
    action[0] = static_cast<float>(i);
    shown = observer.update(sensors, action);
  }
  EXPECT_EQ(shown[at], 3.0F);
  EXPECT_EQ(shown[history + 9 * frame + at], 2.0F);
  EXPECT_EQ(shown[history + 8 * frame + at], 1.0F);
  EXPECT_EQ(shown[history + 7 * frame + at], 7.0F);
  observer.reset();
  action[0] = 5.0F;
  shown = observer.update(sensors, action);
  EXPECT_EQ(shown[history + at], 5.0F);
}

// The shipped networks were trained on these numbers, one after another: not one bit may differ.
TEST(WbcObservation, IsTheBitsThatNetworksWereTrainedOn) {
  Random random(3, 5);
  const auto drawn = [&](int size) {
    Eigen::VectorXd values(size);
    for (double& value : values) value = random.normal();
    return values;
  };
  WbcSensors sensors;
  std::vector<float> past, now;
  WbcObserver observer(WbcKind::kStudent, 29);
  for (int tick = 0; tick < 15; ++tick) {
    sensors.q = drawn(29), sensors.v = drawn(29), sensors.q_ref = drawn(29), sensors.v_ref = drawn(29);
    sensors.w = drawn(3), sensors.velocity_B = drawn(3), sensors.gravity = drawn(3), sensors.root_error = drawn(3);
    sensors.root_turn = drawn(6);
    const Eigen::VectorXf action = drawn(29).cast<float>();
    const auto put = [](std::vector<float>& to, const auto& values) {
      for (const auto value : values) to.push_back(static_cast<float>(value));
    };
    std::vector<float> frame, reference, oracle;
    for (const auto* values : {&sensors.q, &sensors.v}) put(frame, *values), put(oracle, *values);
    put(frame, sensors.w), put(oracle, sensors.w), put(oracle, sensors.velocity_B);
    put(frame, sensors.gravity), put(oracle, sensors.gravity), put(frame, action), put(oracle, action);
    for (const auto* values : {&sensors.q_ref, &sensors.v_ref}) put(reference, *values);
    put(reference, sensors.root_error), put(reference, sensors.root_turn);
    oracle.insert(oracle.end(), reference.begin(), reference.end());
    if (past.empty())
      for (int i = 0; i < 10; ++i) past.insert(past.end(), frame.begin(), frame.end());
    now = frame;
    now.insert(now.end(), reference.begin(), reference.end());
    now.insert(now.end(), past.begin(), past.end());
    past.erase(past.begin(), past.begin() + 93);
    past.insert(past.end(), frame.begin(), frame.end());
    const std::span<const float> student = observer.update(sensors, action);
    ASSERT_EQ(std::vector<float>(student.begin(), student.end()), now) << tick;
    std::vector<float> shown(163);
    write_oracle(sensors, action, shown);
    ASSERT_EQ(shown, oracle) << tick;
  }
}

}  // namespace
}  // namespace duet
