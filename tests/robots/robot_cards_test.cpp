#include "duet/robots/robot_cards.h"

#include <cstdlib>

#include "tests/robots/fixtures.h"

namespace duet {
namespace {

using test::thrown_message;

// $DUET_SHARE for the time of a test.
class RobotCards : public ::testing::Test {
 protected:
  RobotCards() { setenv("DUET_SHARE", (folder_ / "share").c_str(), 1); }
  ~RobotCards() override { unsetenv("DUET_SHARE"); }
  std::string add(const std::string& place, const std::string& card = test::kSmallCard) {
    write_file(folder_ / ("share/robots/" + place), card);
    return folder_ / ("share/robots/" + place);
  }

  test::ScratchFolder folder_;
};

std::vector<std::string> names() {
  std::vector<std::string> names;
  for (const RobotCardFile& card : robot_cards()) names.push_back(card.name);
  return names;
}

TEST_F(RobotCards, AreAllFoldersBelowRobotsTheOneThatStandsInFirst) {
  EXPECT_THAT(names(), testing::ElementsAre("g1", "agibot_x1", "g1_12dof", "g1_27dof", "g1_playground", "g1_twist2",
                                            "h1", "h1_2", "t1", "t1_12dof", "t1_23dof", "xbot_l"));
  EXPECT_EQ(robot_cards().back().folder, "robots/xbot_l");
  EXPECT_EQ(robot_cards().front().path, default_card_path());
}

TEST_F(RobotCards, HaveTheirFilesNameAndLoad) {
  for (const RobotCardFile& card : robot_cards()) EXPECT_EQ(load_robot(card.path).name, card.name);
}

TEST_F(RobotCards, OfDuetShareAreFoundByName) {
  const std::string card = add("small/small.yaml");
  write_file(folder_ / "share/robots/small/small.urdf", test::kSmallUrdf);
  EXPECT_EQ(card_path("small"), card);
  EXPECT_EQ(shipped_card("small"), card);
  EXPECT_EQ(load_shared_robot("small")->dof(), 2);
  EXPECT_THAT(names(), testing::Contains("small"));
  EXPECT_THAT(names(), testing::Contains("t1"));
}

TEST_F(RobotCards, OneNameInTwoFoldersIsRefusedNamingBoth) {
  const std::string a = add("small/small.yaml"), b = add("other/small.yaml");
  EXPECT_EQ(thrown_message<InputError>([] { robot_cards(); }),
            "robot card 'small': expected each name once, found " + b + " and " + a);
  add("mine/g1.yaml");
  EXPECT_SENTENCE(thrown_message<InputError>([] { static_cast<void>(card_path("t1")); }));
}

TEST_F(RobotCards, AnUnknownNameListsAllKnown) {
  EXPECT_SENTENCE(thrown_message<MissingError>([] { static_cast<void>(card_path("t2")); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { static_cast<void>(shipped_card("t2")); }));
}

TEST_F(RobotCards, APathIsTheCardItself) { EXPECT_EQ(card_path("anywhere/mine.yaml"), "anywhere/mine.yaml"); }

TEST_F(RobotCards, ABrokenOneHidesNoOther) {
  add("broken/broken.yaml", "name: [");
  EXPECT_EQ(robot_of_digest(load_shared_robot("t1")->digest)->name, "t1");
  EXPECT_EQ(robot_of_digest("nobody's"), nullptr);
}

}  // namespace
}  // namespace duet
