#include "duet/robots/authoring/robot_check.h"

#include <algorithm>

#include "duet/robots/robot_cards.h"
#include "tests/robots/fixtures.h"
#include "tests/robots/moved_t1.h"

namespace duet {
namespace {

using test::MovedT1;
using test::replaced;

std::string findings_text(const RobotCheck& check) {
  std::string text;
  for (const RobotFinding& finding : check.findings)
    text += fmt::format("{} {}: {}{}{}; ", to_string(finding.state), finding.part, finding.found,
                        finding.next.empty() ? "" : " -> ", finding.next);
  return text + (check.can_run() ? "can run" : "cannot run");
}

RobotCheck check_small(const std::string& card, const std::string& urdf = test::kSmallUrdf) {
  const test::ScratchFolder folder;
  write_file(folder / "small.yaml", card);
  write_file(folder / "small.urdf", urdf);
  return check_robot(folder / "small.yaml");
}

const RobotFinding& finding_of(const RobotCheck& check, const std::string& part) {
  const auto found = std::ranges::find(check.findings, part, &RobotFinding::part);
  require(found != check.findings.end(), "no finding '" + part + "'");
  return *found;
}

TEST(RobotCheck, EveryRobotThatShipsCanRunAndNothingOfItIsWrong) {
  for (const RobotCardFile& card : robot_cards()) {
    const RobotCheck check = check_robot(card.name);
    EXPECT_TRUE(check.can_run()) << findings_text(check);
    for (const RobotFinding& finding : check.findings)
      EXPECT_NE(finding.state, CheckState::kWrong) << card.name << ": " << finding.found;
  }
}

TEST(RobotCheck, SaysTheFiguresOfTheT1) { EXPECT_SENTENCE(findings_text(check_robot("t1"))); }

TEST(RobotCheck, ABodyWithoutLegsLacksWhatARunNeeds) { EXPECT_SENTENCE(findings_text(check_small(test::kSmallCard))); }

// A change of the T1's card or URDF, and the finding that it has to lead to.
struct CardDefect {
  const char* name;
  bool in_urdf;
  const char *from, *to, *part;
  CheckState state;
  bool stops;
};

std::ostream& operator<<(std::ostream& out, const CardDefect& defect) { return out << defect.name; }

class RobotCheckOf : public testing::TestWithParam<CardDefect> {};

TEST_P(RobotCheckOf, NamesTheDefect) {
  const CardDefect& defect = GetParam();
  const MovedT1 moved({0.0, 0.0, 0.0});
  const std::string file = defect.in_urdf ? moved.folder / "t1.urdf" : moved.card;
  write_file(file, replaced(read_file(file), defect.from, defect.to));
  const RobotCheck check = check_robot(moved.card);
  const RobotFinding& finding = finding_of(check, defect.part);
  EXPECT_EQ(finding.state, defect.state) << findings_text(check);
  EXPECT_EQ(finding.stops, defect.stops);
  EXPECT_EQ(check.can_run(), !defect.stops) << findings_text(check);
  EXPECT_FALSE(finding.next.empty());
  EXPECT_SENTENCE(finding.found);
}

constexpr CheckState kMissing = CheckState::kMissing, kWrong = CheckState::kWrong, kNote = CheckState::kNote;

INSTANTIATE_TEST_SUITE_P(
    T1, RobotCheckOf,
    testing::Values(
        CardDefect{"joint_left_out", false,
                   "  - {name: Waist,                 armature: 0.03, kp: 200, kd:   5, neutral:     0}\n", "",
                   "joints", kMissing, true},
        CardDefect{"hand_is_a_sole", false, "radius: 0.045, region: hand}", "radius: 0.045, region: hand, sole: true}",
                   "soles", kWrong, true},
        CardDefect{"one_foot_high", false, "center: [-0.07, -0.042, -0.03], radius: 0.01, region: foot, sole: true}",
                   "center: [-0.07, -0.042, -0.06], radius: 0.01, region: foot, sole: true}", "soles", kWrong, false},
        CardDefect{
            "ankle_turned", false, "{name: Left_Ankle_Pitch,      armature: 0.03, kp:  50, kd:   3, neutral: -0.25}",
            "{name: Left_Ankle_Pitch,      armature: 0.03, kp:  50, kd:   3, neutral: 0.2}", "sides", kWrong, false},
        CardDefect{"kp_slips", false, "{name: Right_Knee_Pitch,      armature: 0.03, kp: 200",
                   "{name: Right_Knee_Pitch,      armature: 0.03, kp: 20", "sides", kWrong, false},
        CardDefect{"fallen_where_it_stands", false, "fall: {height: 0.38", "fall: {height: 0.67", "heights", kWrong,
                   true},
        CardDefect{"no_track_of_a_hand", false, "  lhand: left_palm_link\n", "", "tracks", kMissing, true},
        CardDefect{"hands_exchanged", false, "  lhand: left_palm_link\n  rhand: right_palm_link\n",
                   "  lhand: right_palm_link\n  rhand: left_palm_link\n", "tracks", kWrong, false},
        CardDefect{"stance_of_another", false, "half_width: 0.106", "half_width: 0.16", "stance", kWrong, false},
        CardDefect{"no_gain", false, "kp:   5, kd: 0.5, neutral:     0}", "kp: 0, kd: 0, neutral: 0}", "gains",
                   kMissing, false},
        CardDefect{"leans", false, "armature: 0.03, kp: 200, kd:   5, neutral:  -0.2}",
                   "armature: 0.03, kp: 200, kd:   5, neutral:  0.9}", "sides", kWrong, false},
        CardDefect{"unmeasured", false, "push_link: Trunk", "push_link: Trunk  # assumed", "assumed", kNote, false},
        CardDefect{"unknown_frame", false, "  head: head_link", "  head: no_link", "card", kWrong, true}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(RobotCheck, AMimicJointPassesWhereItIsLocked) {
  const std::string urdf = replaced(test::kSmallUrdf, "<limit effort=\"7\" velocity=\"8\"/>",
                                    "<limit effort=\"7\" velocity=\"8\"/><mimic joint=\"shoulder\" multiplier=\"2\"/>");
  const RobotCheck free = check_small(test::kSmallCard, urdf);
  EXPECT_FALSE(free.can_run());
  EXPECT_SENTENCE(finding_of(free, "joints").found);
  EXPECT_SENTENCE(finding_of(free, "joints").next);
  const std::string locked = replaced(test::kSmallCard, "  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}\n",
                                      "locked:\n  - {name: elbow, position: 0.6}\n");
  EXPECT_EQ(finding_of(check_small(locked, urdf), "joints").found, "1 move, 1 are locked, 1 fixed");
}

TEST(RobotCheck, SaysEveryLinkWithoutMassAndInertiasThatAreNoBodys) {
  std::string urdf = replaced(test::kSmallUrdf, "<mass value=\"2\"/>", "<mass value=\"0\"/>");
  EXPECT_SENTENCE(findings_text(check_small(test::kSmallCard, urdf)));
  urdf = replaced(test::kSmallUrdf, "ixx=\"0.02\" iyy=\"0.03\"", "ixx=\"0.002\" iyy=\"0.03\"");
  urdf = replaced(urdf, "ixx=\"0.001\" iyy=\"0.001\" izz=\"0.001\"", "ixx=\"1000\" iyy=\"1000\" izz=\"1000\"");
  EXPECT_SENTENCE(finding_of(check_small(test::kSmallCard, urdf), "inertias").found);
}

TEST(RobotCheck, DynamicsAreSaid) {
  const std::string urdf = replaced(test::kSmallUrdf, "<limit effort=\"7\" velocity=\"8\"/>",
                                    "<limit effort=\"7\" velocity=\"8\"/><dynamics damping=\"2\" friction=\"0.1\"/>");
  const RobotCheck check = check_small(test::kSmallCard, urdf);
  EXPECT_EQ(finding_of(check, "dynamics").state, kNote);
  EXPECT_THAT(finding_of(check, "dynamics").found, testing::HasSubstr("of 1 joints (damping up to 2 N m s/rad"));
}

TEST(RobotCheck, WhatIsNoCardOrNoUrdfIsRefused) {
  const auto refused = [](const std::string& urdf) {
    return test::thrown_message<InputError>([&] { check_small(test::kSmallCard, urdf); });
  };
  for (const std::string& urdf :
       {std::string("solid foot\nfacet normal 0 0 1\n"), std::string("binary\0stl", 10), std::string("<mujoco/>"),
        std::string("<COLLADA/>"),
        std::string("<robot name=\"r\" xmlns:xacro=\"x\"><xacro:include filename=\"a\"/></robot>"),
        std::string("<html><body>not found</body></html>"), std::string(""),
        replaced(test::kSmallUrdf, "<parent link=\"brick\"/><child link=\"lower\"/>",
                 "<parent link=\"lower\"/><child link=\"upper\"/>")})
    EXPECT_SENTENCE(refused(urdf));
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { check_small("name: [", ""); }));
  EXPECT_SENTENCE(test::thrown_message<MissingError>([] { check_robot("t2"); }));
}

}  // namespace
}  // namespace duet
