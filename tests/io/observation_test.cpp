#include "duet/io/observation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

namespace duet {
namespace {

using Numbers = std::vector<float>;

Channel values(int size) { return {.kind = ChannelKind::kNoise, .size = size}; }

// Two groups, "a" of one number and "b" of two; an input of both now and the last two of "a" before.
ObservationLayout two_groups() {
  ObservationLayout layout;
  layout.groups = {{.name = "a", .line = 1, .channels = {values(1)}},
                   {.name = "b", .line = 2, .channels = {values(2)}}};
  layout.inputs = {{.name = "",
                    .line = 3,
                    .parts = {{.groups = {1, 0}}, {.groups = {0}, .history = {.frames = 2, .current = false}}},
                    .state = ""}};
  return layout;
}

TEST(ObservationWriter, PutsGroupsSideBySideAndHistoriesBehindThem) {
  ObservationWriter writer(two_groups(), {});
  double now = 0.0;
  const auto show = [&](const Channel& channel, ChannelWriter& out) {
    for (int i = 0; i < channel.size; ++i) out(now + 10.0 * i + (channel.size == 2 ? 100.0 : 0.0));
  };
  const auto seen = [&] {
    writer.update(show);
    return Numbers(writer.input(0).begin(), writer.input(0).end());
  };
  now = 1.0;
  EXPECT_EQ(seen(), (Numbers{101, 111, 1, 0, 0}));
  now = 2.0;
  EXPECT_EQ(seen(), (Numbers{102, 112, 2, 0, 1}));
  now = 3.0;
  EXPECT_EQ(seen(), (Numbers{103, 113, 3, 1, 2}));
  writer.reset();
  now = 4.0;
  EXPECT_EQ(seen(), (Numbers{104, 114, 4, 0, 0}));
}

TEST(ObservationLayout, SaysSizesAndBlocks) {
  const ObservationLayout layout = two_groups();
  EXPECT_EQ(layout.input_size(layout.inputs[0], {}), 5);
  EXPECT_EQ(layout_text(layout.blocks(layout.inputs[0], {}, ChannelFormat::kPolicy)),
            "noise 0..1, noise 2; noise 3 (2 frames of 1)");
}

TEST(WriteChannels, ScalesOneForAllOrOneEachThenBounds) {
  Channel each = values(2), all = values(2);
  each.scale = {2.0, -3.0};
  all.scale = {0.5};
  all.clip = 1.0;
  Numbers out(4);
  write_channels(
      std::vector<Channel>{each, all}, [](const Channel&, ChannelWriter& to) { to(Eigen::Vector2d(1.0, 4.0)); }, out);
  EXPECT_EQ(out, (Numbers{2.0F, -12.0F, 0.5F, 1.0F}));
}

TEST(WriteChannels, KeepsWhatIsNotANumber) {
  Channel bounded = values(1);
  bounded.clip = 1.0;
  Numbers out(2);
  write_channels(
      std::vector<Channel>{bounded, values(1)},
      [](const Channel&, ChannelWriter& to) { to(std::numeric_limits<double>::quiet_NaN()); }, out);
  EXPECT_TRUE(std::isnan(out[0]) && std::isnan(out[1]));
}

TEST(WriteChannels, RefusesAChannelThatShowsMoreOrLessThanItsSize) {
  Numbers out(2);
  const std::vector<Channel> channels = {values(2)};
  EXPECT_THROW(write_channels(
                   channels, [](const Channel&, ChannelWriter& to) { to(1.0); }, out),
               std::logic_error);
  EXPECT_THROW(write_channels(
                   channels, [](const Channel&, ChannelWriter& to) { to(Eigen::Vector3d::Zero()); }, out),
               std::logic_error);
}

}  // namespace
}  // namespace duet
