#include "duet/io/channel.h"

#include <set>

#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

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

}  // namespace
}  // namespace duet
