// Laws for the layouts of all published controllers: resets, allocation, and what is refused.
#include "duet/core/require.h"
#include "tests/backends/allocation_count.h"
#include "tests/controllers/layout.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::Layout;
using test::thrown_message;

TEST(Layouts, StartAgainAtAReset) {
  for (const auto& [name, input, output] :
       {std::tuple{"homie", 456, 12}, std::tuple{"twist2", 1432, 29}, std::tuple{"rl_gym", 47, 12}}) {
    Layout l(name, input, output);
    l.act();
    const std::vector<float> first = l.memory.shown[0];
    l.act();
    EXPECT_NE(l.memory.shown[0], first) << name;
    l.controller->reset(l.state);
    l.act();
    EXPECT_EQ(l.memory.shown[0], first) << name;
    EXPECT_EQ(l.memory.resets, 2);
  }
}

TEST(Layouts, AreFilledWithoutAllocation) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: the sanitizer counts";
  const std::tuple<const char*, int, int, const char*, const char*> all[] = {
      {"homie", 456, 12, "x", "y"},          {"twist2", 1432, 29, "x", "y"},
      {"rl_gym", 47, 12, "x", "y"},          {"playground", 103, 29, "x", "y"},
      {"gmt", 2154, 23, "x", "y"},           {"holosoma", 100, 29, "x", "y"},
      {"falcon", 575, 29, "x", "y"},         {"falcon_dec_loco", 102, 15, "x", "y"},
      {"unitree_rl_lab", 480, 29, "x", "y"}, {"unitree_rl_mjlab", 96, 29, "x", "y"},
      {"rl_sar_dance", 154, 29, "x", "y"},   {"beyond_mimic", 160, 29, "obs", "actions"}};
  for (const auto& [name, input, output, in, out] : all) {
    Layout l(name, input, output, {}, in, out);
    l.act();
    const long before = test::allocation_count();
    for (int tick = 0; tick < 20; ++tick) {
      l.go_on();
      l.act();
    }
    EXPECT_EQ(test::allocation_count(), before) << name;
  }
}

TEST(Layouts, RefuseANetworkOfAnotherSizeWithThePlacesOfTheChannels) {
  const std::string message = thrown_message<InputError>([] { Layout("rl_gym", 48, 12); });
  EXPECT_SENTENCE(message);
  EXPECT_SENTENCE(thrown_message<InputError>([] { Layout("homie", 400, 12); }));
  EXPECT_SENTENCE(thrown_message<InputError>([] { Layout("rl_gym", 47, 29); }));
  EXPECT_SENTENCE(thrown_message<InputError>([] { Layout("beyond_mimic", 160, 29, {}, "observation", "actions"); }));
}

TEST(Layouts, RefuseARobotOfOtherJoints) {
  const auto make = [](const char* name, const char* card, int input, int output) {
    return thrown_message<std::invalid_argument>([=] {
      test::FakeMemory memory;
      make_descriptor_controller(load_descriptor(name), test::body(card),
                                 std::make_unique<test::FakeNetwork>(std::vector<Port>{{"x", input}},
                                                                     std::vector<Port>{{"y", output}}, memory),
                                 "fake");
    });
  };
  EXPECT_SENTENCE(make("twist2", "g1_12dof", 1432, 29));
  EXPECT_SENTENCE(make("twist2", "g1_27dof", 1432, 29));
}

TEST(Layouts, RefuseOptionsValuesTheyDoNotKnow) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { Layout("homie", 456, 12, {{"command", "1,2"}}); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { Layout("homie", 456, 12, {{"conversion", "direkt"}}); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { Layout("homie", 456, 12, {{"waist", "stiff"}}); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { Layout("homie", 456, 12, {{"yaw_scale", "fast"}}); }));
}

}  // namespace
}  // namespace duet
