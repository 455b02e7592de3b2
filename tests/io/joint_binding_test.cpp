#include <gmock/gmock.h>

#include "duet/io/channel.h"

namespace duet {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(JointBinding, FindsJointsByNameInTheFilesOrder) {
  RobotModel robot;
  for (const char* name : {"hip", "knee", "ankle"}) robot.joints.push_back({.name = name});
  const std::vector<std::string> all = {"ankle", "hip", "knee"};
  const JointBinding whole = bind_by_name(all, robot);
  EXPECT_THAT(whole.indices, ElementsAre(2, 0, 1));
  EXPECT_THAT(whole.absent, IsEmpty());
  EXPECT_THAT(whole.unnamed, IsEmpty());
}

TEST(JointBinding, SaysWhatEitherLacks) {
  RobotModel robot;
  for (const char* name : {"hip", "knee", "ankle"}) robot.joints.push_back({.name = name});
  const std::vector<std::string> some = {"knee", "toe", "Hip"};
  const JointBinding part = bind_by_name(some, robot);
  EXPECT_THAT(part.indices, ElementsAre(1, -1, -1));
  EXPECT_THAT(part.absent, ElementsAre("toe", "Hip"));
  EXPECT_THAT(part.unnamed, ElementsAre("hip", "ankle"));
}

}  // namespace
}  // namespace duet
