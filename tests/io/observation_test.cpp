#include "duet/io/observation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>

#include "duet/io/bound_network.h"
#include "duet/io/channel.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::ElementsAre;

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

constexpr ChannelFormat kFormats[] = {ChannelFormat::kController, ChannelFormat::kPolicy, ChannelFormat::kNetwork};

TEST(ChannelTable, IsInTheOrderOfItsKinds) {
  for (std::size_t i = 0; i < channel_table().size(); ++i)
    EXPECT_EQ(static_cast<std::size_t>(channel_table()[i].kind), i) << channel_table()[i].meaning;
  EXPECT_EQ(static_cast<std::size_t>(ChannelKind::kNoise) + 1, channel_table().size());
}

TEST(ChannelTable, NamesEachKindOnceInAFormatAndFindsItByName) {
  for (const ChannelFormat format : kFormats) {
    const std::vector<std::string> names = channel_names(format);
    EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
    for (const std::string& name : names) EXPECT_EQ(channel_name(channel_kind(name, format), format), name);
  }
}

TEST(ChannelTable, LeavesNoChannelWithoutAFormat) {
  for (const ChannelRow& row : channel_table())
    EXPECT_FALSE(std::string(row.controller).empty() && std::string(row.policy).empty() &&
                 std::string(row.network).empty())
        << row.meaning;
}

TEST(ChannelTable, RefusesTheNameOfAnotherFormatWithTheNearestOfThisOne) {
  EXPECT_SENTENCE(
      thrown_message<std::invalid_argument>([] { channel_kind("joint_offsets", ChannelFormat::kController); }));
  EXPECT_SENTENCE(
      thrown_message<std::invalid_argument>([] { channel_kind("joint_positions", ChannelFormat::kController); }));
  EXPECT_SENTENCE(
      thrown_message<std::invalid_argument>([] { channel_kind("joint_position", ChannelFormat::kPolicy); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { channel_kind("", ChannelFormat::kNetwork); }));
}

TEST(ChannelSize, IsTheTablesOrThatOfWhatIsGiven) {
  const ChannelWidths widths = {.joints = 7, .actions = 5};
  EXPECT_EQ(channel_size({.kind = ChannelKind::kPartnerJoints}, widths), 72);
  EXPECT_EQ(channel_size({.kind = ChannelKind::kJointVelocity}, widths), 7);
  EXPECT_EQ(channel_size({.kind = ChannelKind::kJointVelocity, .joints = {4, 1}}, widths), 2);
  EXPECT_EQ(channel_size({.kind = ChannelKind::kPreviousAction}, widths), 5);
  EXPECT_EQ(channel_size({.kind = ChannelKind::kGravity, .axes = {2}}, widths), 1);
  EXPECT_EQ(channel_size({.kind = ChannelKind::kReferenceFrames, .joints = {0, 1}, .steps = {1, 3, 9}}, widths), 27);
  EXPECT_EQ(channel_size({.kind = ChannelKind::kNoise, .size = 180}, widths), 180);
}

TEST(Layout, SaysThePlaceOfEachEntryAndTheFramesOfEachBlock) {
  const std::vector<LayoutBlock> blocks = {
      {{{"gyro", 3}, {"height", 1}}, 1}, {{{"joints", 29}}, 5}, {{{"tick", 1}}, 2}};
  EXPECT_EQ(layout_text(blocks), "gyro 0..2, height 3; joints 4..32 (5 frames of 29); tick 149 (2 frames of 1)");
  EXPECT_EQ(layout_size(blocks), 4 + 145 + 2);
  EXPECT_EQ(blocks[0].frame_size(), 4);
}

TEST(Layout, OfNothingIsEmpty) {
  EXPECT_EQ(layout_text({}), "");
  EXPECT_EQ(layout_size({}), 0);
}

// The history as it is shown after each frame (k, 10 k).
std::vector<std::vector<float>> shown(FrameHistory& history, int count) {
  std::vector<std::vector<float>> all;
  for (int k = 1; k <= count; ++k) {
    const float frame[] = {static_cast<float>(k), 10.0F * static_cast<float>(k)};
    all.emplace_back(history.size());
    history.add(frame, all.back());
  }
  return all;
}

TEST(FrameHistory, IsOldestFirstFromZeros) {
  FrameHistory history(2, {.frames = 3});
  EXPECT_EQ(history.size(), 6);
  EXPECT_THAT(shown(history, 4), ElementsAre(ElementsAre(0, 0, 0, 0, 1, 10), ElementsAre(0, 0, 1, 10, 2, 20),
                                             ElementsAre(1, 10, 2, 20, 3, 30), ElementsAre(2, 20, 3, 30, 4, 40)));
}

TEST(FrameHistory, MayBeginWithItsFirstFrameRepeated) {
  FrameHistory history(2, {.frames = 3, .starts_full = true});
  EXPECT_THAT(shown(history, 2), ElementsAre(ElementsAre(1, 10, 1, 10, 1, 10), ElementsAre(1, 10, 1, 10, 2, 20)));
}

TEST(FrameHistory, MayLeaveTheCurrentFrameOut) {
  FrameHistory history(2, {.frames = 2, .current = false});
  EXPECT_THAT(shown(history, 3),
              ElementsAre(ElementsAre(0, 0, 0, 0), ElementsAre(0, 0, 1, 10), ElementsAre(1, 10, 2, 20)));
  FrameHistory full(2, {.frames = 2, .current = false, .starts_full = true});
  EXPECT_THAT(shown(full, 2), ElementsAre(ElementsAre(1, 10, 1, 10), ElementsAre(1, 10, 1, 10)));
}

TEST(FrameHistory, StartsAgainAtAReset) {
  for (const bool full : {false, true}) {
    FrameHistory history(2, {.frames = 3, .starts_full = full});
    const auto first = shown(history, 3);
    history.reset();
    EXPECT_EQ(shown(history, 3), first);
  }
}

}  // namespace
}  // namespace duet
