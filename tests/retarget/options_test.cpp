#include "duet/retarget/options.h"

#include <limits>

#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

TEST(PairOptions, DefaultsArePrintedValues) {
  const PairOptions options;
  EXPECT_EQ(pair_option(options, "w-kin"), "1");
  EXPECT_EQ(pair_option(options, "w-con"), "0.25");
  EXPECT_EQ(pair_option(options, "w-hum"), "0.25");
  EXPECT_EQ(pair_option(options, "w-temp"), "5");
  EXPECT_EQ(pair_option(options, "w-pose"), "0.02");
  EXPECT_EQ(pair_option(options, "stage1-iterations"), "150");
  EXPECT_EQ(pair_option(options, "stage1-rate"), "0.02");
  EXPECT_EQ(pair_option(options, "stage2-iterations"), "50");
  EXPECT_EQ(pair_option(options, "stage2-rate"), "0.005");
  EXPECT_EQ(pair_option(options, "stage2-contact-scale"), "10");
  EXPECT_EQ(pair_option(options, "keypoints"), "nine");
  EXPECT_EQ(pair_option(options, "root"), "constant-offset");
}

TEST(PairOptions, TextFormsRoundTrip) {
  const std::vector<std::pair<std::string, std::string>> values = {{"mode", "grounded"},
                                                                   {"w-kin", "0.3"},
                                                                   {"w-con", "1e-05"},
                                                                   {"w-hum", "2"},
                                                                   {"w-temp", "0"},
                                                                   {"w-acceleration", "10"},
                                                                   {"w-pose", "0.5"},
                                                                   {"w-bone", "1"},
                                                                   {"w-partner", "0.7"},
                                                                   {"w-collision", "3"},
                                                                   {"w-object", "0.5"},
                                                                   {"w-hand", "2"},
                                                                   {"stage1-iterations", "7"},
                                                                   {"stage1-rate", "0.125"},
                                                                   {"stage2-iterations", "0"},
                                                                   {"stage2-rate", "0.25"},
                                                                   {"stage2-contact-scale", "3"},
                                                                   {"keep-moments", "off"},
                                                                   {"adam-epsilon", "0.001"},
                                                                   {"kin-loss", "mean-norm"},
                                                                   {"contact-reduction", "mean"},
                                                                   {"contact-blocks", "cross"},
                                                                   {"root", "per-frame"},
                                                                   {"keypoints", "eleven"},
                                                                   {"keypoint-list", "head,left_hand:2:0.5"},
                                                                   {"rest-pose", "neutral"},
                                                                   {"contact-range", "1.5"},
                                                                   {"joint-speeds", "on"},
                                                                   {"filter", "off"},
                                                                   {"adapt-human", "off"},
                                                                   {"kernel", "scalar"},
                                                                   {"optimizer", "lbfgs"},
                                                                   {"lbfgs-iterations", "7"},
                                                                   {"lbfgs-tolerance", "0.001"},
                                                                   {"ground", "off"},
                                                                   {"root-smoothing", "0.3"},
                                                                   {"step-speed", "0.9"},
                                                                   {"smpl", "a path.npz"}};
  PairOptions options;
  ASSERT_EQ(values.size(), pair_option_names().size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto& [name, value] = values[i];
    EXPECT_EQ(pair_option_names()[i], name);
    EXPECT_NE(pair_option(options, name), value) << name;
    set_pair_option(options, name, value);
    EXPECT_EQ(pair_option(options, name), value) << name;
  }
  EXPECT_EQ(options.contact_blocks, ContactBlocks::kCross);
  EXPECT_EQ(options.keypoints, ContactKeypoints::kEleven);
  EXPECT_EQ(options.kernel, KernelKind::kScalar);
  EXPECT_DOUBLE_EQ(options.weights.kin, 0.3);
}

TEST(PairOptions, UnknownNameOrValueListsTheKnownOnes) {
  PairOptions options;
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { set_pair_option(options, "root", "free"); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { set_pair_option(options, "w-kim", "1"); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { static_cast<void>(pair_option(options, "rot")); }));
  for (const char* bad : {"", "nan", "inf", "-1", "1x", " 1"}) {
    EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { set_pair_option(options, "w-kin", bad); }));
    EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { set_pair_option(options, "stage1-iterations", bad); }));
  }
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { set_pair_option(options, "keypoint-list", "head:x"); }));
  EXPECT_EQ(pair_option(options, "w-kin"), "1");
}

TEST(PairOptions, ValidateRefusesBadNumbersAndNoIterations) {
  PairOptions options;
  EXPECT_NO_THROW(validate(options));
  options.weights.temp = std::numeric_limits<double>::quiet_NaN();
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { validate(options); }));
  options = {};
  options.schedule.stage1_iterations = 0;
  options.schedule.stage2_iterations = 0;
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { validate(options); }));
}

}  // namespace
}  // namespace duet
