// `duet robot`: what it says and its exit codes.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/app/program.h"

namespace duet {
namespace {

using test::Answer;
using test::duet_program;
using ::testing::HasSubstr;

const std::string kT1 = std::string(DUET_SOURCE_DIR) + "/robots/t1/";

TEST(RobotCommand, CheckSaysThatARunCanBegin) {
  const Answer answer = duet_program("robot check t1_12dof");
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("A run can begin.\n"));
  EXPECT_THAT(answer.out, HasSubstr("booster_gym"));
  const auto json = nlohmann::json::parse(duet_program("robot check --json t1").out);
  EXPECT_TRUE(json.at("can_run").get<bool>());
  EXPECT_EQ(json.at("findings").at(0).at("found"), "29 move, 0 are locked, 2 fixed");
}

TEST(RobotCommand, CheckExitsWithOneWhereNoRunCanBegin) {
  const test::ScratchFolder folder;
  write_file(folder / "small.yaml",
             "name: small\nextends: " + std::string("t1.yaml\n") + "tracks: {head: head_link}\n");
  for (const char* name : {"t1.yaml", "t1.urdf"}) write_file(folder / name, read_file(kT1 + name));
  const Answer answer = duet_program("robot check " + (folder / "small.yaml"));
  EXPECT_EQ(answer.code, 1) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("missing  tracks"));
  EXPECT_THAT(answer.out, HasSubstr("No run can begin.\n"));
}

TEST(RobotCommand, CheckRefusesWhatIsNoCard) {
  const test::ScratchFolder folder;
  write_file(folder / "xacro.yaml", "name: x\nurdf: x.urdf\nbase: b\njoints: []\n");
  write_file(folder / "x.urdf", "<robot name='x'><link name='${prefix}b'/></robot>");
  const Answer xacro = duet_program("robot check " + (folder / "xacro.yaml"));
  EXPECT_EQ(xacro.code, 2);
  EXPECT_THAT(xacro.err, HasSubstr("xacro is not expanded"));
  EXPECT_EQ(duet_program("robot check " + kT1 + "t1.urdf").code, 4);
  EXPECT_EQ(duet_program("robot check").code, 2);
  EXPECT_EQ(duet_program("robot").code, 2);
}

TEST(RobotCommand, NewWritesACardThatCheckReads) {
  const test::ScratchFolder folder;
  write_file(folder / "t1.urdf", read_file(kT1 + "t1.urdf"));
  const std::string card = folder / "mine.yaml", make = "robot new " + (folder / "t1.urdf") + " -o " + card;
  const Answer made = duet_program(make);
  EXPECT_EQ(made.code, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("a card of 'mine'"));
  EXPECT_THAT(made.err, HasSubstr("proposed: legs: 6 hinges a side: pitch, roll, yaw, pitch, pitch, roll"));
  EXPECT_EQ(duet_program("robot check " + card).code, 0);
  const std::string text = read_file(card);
  EXPECT_THAT(text, HasSubstr("urdf: t1.urdf\n"));
  const Answer again = duet_program(make + " --name other");
  EXPECT_EQ(again.code, 2);
  EXPECT_THAT(again.err, HasSubstr("expected a new file, found one that is there: --force writes over it"));
  EXPECT_EQ(read_file(card), text);
  EXPECT_EQ(duet_program(make + " --name other --force").code, 0);
  EXPECT_THAT(read_file(card), HasSubstr("name: other\n"));
  EXPECT_EQ(duet_program("robot new " + (folder / "t1.urdf") + " -o " + (folder / "card.txt")).code, 2);
  EXPECT_THAT(duet_program("robot new " + (folder / "t1.urdf")).out, HasSubstr("# Scaffold of a robot card"));
}

}  // namespace
}  // namespace duet
