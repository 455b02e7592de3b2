
#include "duet/hardware/twin/twin_operator.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "tests/hardware/limited_robot.h"
#include "tests/support.h"

namespace duet {
namespace {

TEST(TwinFault, IsReadFromText) {
  const TwinFault fault = parse_twin_fault("drop@3:5.5=100");
  EXPECT_EQ(fault.kind, TwinFaultKind::kDrop);
  EXPECT_EQ(fault.begin, 3.0);
  EXPECT_EQ(fault.end, 5.5);
  EXPECT_EQ(fault.value, 100.0);
  EXPECT_EQ(parse_twin_fault("freeze@0:1").kind, TwinFaultKind::kFreeze);
}

TEST(TwinFault, RefusesWhatItCannotRead) {
  const auto refusal = [](const char* text) {
    return test::thrown_message<std::invalid_argument>([&] { (void)parse_twin_fault(text); });
  };
  for (const char* text :
       {"", "drop", "drop@3", "drop:3@5", "drop@x:5", "drop@3:5=", "drop@5:3=1", "drop@3:5=-1", "drop@3:3"})
    EXPECT_SENTENCE(refusal(text));
  EXPECT_SENTENCE(refusal("dorp@3:5"));
}

// The states of two seconds at 100 Hz, as they leave, with a fault in the second one.
std::vector<LowStateFrame> states_with(const std::string& fault, TwinModel& twin) {
  FaultyTwin faulty(twin, {parse_twin_fault(fault)}, 1);
  std::vector<LowStateFrame> states;
  for (int k = 0; k < 200; ++k) {
    LowStateFrame frame;
    if (faulty.next_state(0.01 * k, frame)) states.push_back(frame);
  }
  return states;
}

long bad_checksums(const std::vector<LowStateFrame>& states) {
  return std::ranges::count_if(states, [](const auto& state) { return state.crc != checksum_of(state); });
}

TEST(TwinFault, DropsDelaysFlipsAndFreezes) {
  TwinModel dropped(test::g1(), {}), late(test::g1(), {}), flipped(test::g1(), {}), frozen(test::g1(), {});
  EXPECT_EQ(states_with("drop@1:2=100", dropped).size(), 100u);
  EXPECT_NEAR(states_with("delay@1:2=50", late).size(), 195, 1);
  EXPECT_NEAR(bad_checksums(states_with("flip@1:2=50", flipped)), 50, 20);
  const std::vector<LowStateFrame> states = states_with("freeze@1:2", frozen);
  EXPECT_EQ(states.back().tick, 100u);
  EXPECT_EQ(bad_checksums(states), 0);
}

TEST(TwinFault, ChangesWhatTheRobotReports) {
  TwinModel twin(test::g1(), {});
  const auto last = [&](const char* fault) {
    RobotReading reading;
    FaultyTwin faulty(twin, {parse_twin_fault(fault)}, 1);
    LowStateFrame frame;
    EXPECT_TRUE(faulty.next_state(1.5, frame));
    (void)read_state(frame, reading);
    return reading;
  };
  EXPECT_EQ(last("hot@1:2=110").health.winding, 110.0);
  EXPECT_NEAR(last("tilt@1:2=0.6").health.tilt, 0.6, 1e-6);
  EXPECT_FALSE(last("remote_lost@1:2").remote.heard);
  EXPECT_EQ(last("mode@1:2").mode_machine, 6);
  twin.remote.keys = 0xFFFF;
  EXPECT_FALSE(last("dead_man@1:2").remote.holds(RemoteKey::kR1));
  EXPECT_FALSE(last("nan@1:2").any);
}

}  // namespace
}  // namespace duet
