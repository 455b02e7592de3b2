#include <gmock/gmock.h>

#include "duet/retarget/options.h"
#include "duet/retarget/pair_chain.h"
#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::ElementsAre;

std::string refusal(const std::string& text) {
  return thrown_message<std::invalid_argument>([&] { static_cast<void>(parse_contact_keypoints(text)); });
}

TEST(ContactKeypoints, TextGoesThereAndBack) {
  const std::string text = "left_hand:2,right_hand@right_wrist_yaw_link:0.5:3,head,left_wrist:1:0";
  const std::vector<ContactKeypoint> keypoints = parse_contact_keypoints(text);
  ASSERT_EQ(keypoints.size(), 4U);
  EXPECT_EQ(keypoints[0], (ContactKeypoint{.smpl = kLeftHand, .weight = 2.0}));
  EXPECT_EQ(keypoints[1],
            (ContactKeypoint{.smpl = kRightHand, .frame = "right_wrist_yaw_link", .weight = 0.5, .object = 3.0}));
  EXPECT_EQ(keypoints[2], (ContactKeypoint{.smpl = kHead}));
  EXPECT_EQ(format_contact_keypoints(keypoints), text);
  EXPECT_TRUE(parse_contact_keypoints("").empty());
}

TEST(ContactKeypoints, FaultsSayWhatWasExpected) {
  EXPECT_SENTENCE(refusal("left_hnd"));
  EXPECT_SENTENCE(refusal("head,head:2"));
  for (const char* bad : {"head:", "head:-1", "head:nan", "head:inf", "head:1x", "head:1:-0.1"})
    EXPECT_SENTENCE(refusal(bad));
  for (const char* bad : {"head:1:1:1", "head@", "head@a@b"}) EXPECT_SENTENCE(refusal(bad));
  EXPECT_EQ(refusal("head:0"), "(nothing was thrown)");
}

TEST(ContactKeypoints, AnObjectIsSeenByHandsElseByWristsUnlessTold) {
  EXPECT_THAT(object_weights(parse_contact_keypoints("head,left_wrist,left_hand,right_hand")), ElementsAre(0, 0, 1, 1));
  EXPECT_THAT(object_weights(parse_contact_keypoints("head,left_wrist,right_wrist")), ElementsAre(0, 1, 1));
  EXPECT_THAT(object_weights(parse_contact_keypoints("head:1:4,left_hand:1:0,right_hand")), ElementsAre(4, 0, 1));
}

TEST(ContactKeypoints, FramesAreTheCardsOrTheNamedOnes) {
  const RobotModel& robot = test::g1();
  const PairChain nine = make_chain(robot, ContactKeypoints::kNine);
  const PairChain listed =
      make_chain(robot, ContactKeypoints::kNine,
                 parse_contact_keypoints("head,left_shoulder,right_shoulder,left_elbow,right_elbow,"
                                         "left_wrist,right_wrist,left_hand,right_hand"));
  for (std::size_t i = 0; i < nine.key_smpl.size(); ++i) {
    const auto at = std::find(listed.key_smpl.begin(), listed.key_smpl.end(), nine.key_smpl[i]);
    ASSERT_NE(at, listed.key_smpl.end());
    EXPECT_EQ(listed.key_points[at - listed.key_smpl.begin()], nine.key_points[i]);
  }
  EXPECT_FALSE(nine.weighted());
  EXPECT_FALSE(listed.weighted());
  EXPECT_EQ(std::count(nine.key_object.begin(), nine.key_object.end(), 1.0), 2);
  EXPECT_TRUE(make_chain(robot, ContactKeypoints::kNine, parse_contact_keypoints("head:0.5")).weighted());
  const std::string frame = robot.frames[robot.pairs.front().frame].name;
  EXPECT_EQ(robot_frames(robot, parse_contact_keypoints("head@" + frame)), std::vector{robot.pairs.front().frame});
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>(
      [&] { static_cast<void>(robot_frames(robot, parse_contact_keypoints("head@nothing"))); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>(
      [&] { static_cast<void>(robot_frames(robot, parse_contact_keypoints("spine2"))); }));
}

}  // namespace
}  // namespace duet
