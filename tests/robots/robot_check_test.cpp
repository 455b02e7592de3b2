#include "duet/robots/authoring/robot_check.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>

#include "duet/robots/authoring/card_draft.h"
#include "duet/robots/authoring/limbs.h"
#include "duet/robots/card.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/robot_cards.h"
#include "duet/robots/urdf.h"
#include "tests/robots/fixtures.h"
#include "tests/robots/moved_t1.h"

namespace duet {
namespace {

using test::MovedT1;
using test::replaced;
using ::testing::ElementsAreArray;

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

// Cards whose roles somebody wrote by hand, with the path of a URDF: in the sources, or below $DUET_SHARED/arena.
struct HandMade {
  const char *card, *urdf;
  bool shared = false;
};

std::ostream& operator<<(std::ostream& out, const HandMade& robot) { return out << robot.card; }

class DraftOf : public testing::TestWithParam<HandMade> {
 protected:
  static std::string urdf_path() {
    const HandMade& robot = GetParam();
    return robot.shared ? test::shared_file(std::string("arena/") + robot.urdf)
                        : std::string(DUET_SOURCE_DIR) + "/robots/" + robot.urdf;
  }
  static RobotModel by_hand() {
    return load_robot(std::string(DUET_SOURCE_DIR) + "/" + GetParam().card, GetParam().shared ? urdf_path() : "");
  }
};

std::vector<std::string> names_of(const RobotModel& robot, const std::vector<int>& joints) {
  std::vector<std::string> names;
  for (const int j : joints) names.push_back(robot.joints[j].name);
  return names;
}

TEST_P(DraftOf, HasTheRolesOfTheCardThatWasWrittenByHand) {
  if (urdf_path().empty()) GTEST_SKIP() << "not run: " << GetParam().urdf << " absent";
  const UrdfModel urdf = parse_urdf(read_text(urdf_path()), urdf_path());
  const Limbs limbs = find_limbs(urdf);
  const RobotModel robot = by_hand();
  const auto names = [&](const std::vector<int>& joints) {
    std::vector<std::string> found;
    for (const int j : joints) found.push_back(urdf.joints[j].name);
    return found;
  };
  for (int side = 0; side < 2; ++side) {
    EXPECT_THAT(names(limbs.legs[side]), ElementsAreArray(names_of(robot, robot.roles.legs[side])));
    EXPECT_THAT(names(limbs.arms[side]), ElementsAreArray(names_of(robot, robot.roles.arms[side])));
    ASSERT_GE(limbs.knee[side], 0);
    const std::string knee = urdf.joints[limbs.knee[side]].name;
    EXPECT_TRUE(knee.find("nee") != std::string::npos) << knee;
  }
  EXPECT_THAT(names(limbs.waist), ElementsAreArray(names_of(robot, robot.roles.waist)));
}

TEST_P(DraftOf, IsACardThatCanRunAndStandsLevel) {
  if (urdf_path().empty()) GTEST_SKIP() << "not run: " << GetParam().urdf << " absent";
  const test::ScratchFolder folder;
  const CardDraft draft = draft_card(read_text(urdf_path()), urdf_path(), "mine", urdf_path());
  write_file(folder / "mine.yaml", draft.text);
  const RobotCheck check = check_robot(folder / "mine.yaml");
  EXPECT_TRUE(check.can_run());
  for (const RobotFinding& finding : check.findings)
    EXPECT_NE(finding.state, CheckState::kWrong) << finding.part << ": " << finding.found;
  const RobotModel robot = load_robot(folder / "mine.yaml"), hand = by_hand();
  const auto hip_height = [](const RobotModel& standing) {
    Kinematics kinematics(standing);
    kinematics.update(standing.standing_state().X_WB, standing.neutral);
    return kinematics.p_WL(standing.roles.legs[0][0] + 1).z();
  };
  EXPECT_NEAR(hip_height(robot), hip_height(hand), 0.05 * hip_height(hand));
  EXPECT_EQ(std::ranges::count(check.findings, std::string("assumed"), &RobotFinding::part), 1);
}

INSTANTIATE_TEST_SUITE_P(Robots, DraftOf,
                         testing::Values(HandMade{"robots/g1/g1.yaml", "g1/g1.urdf"},
                                         HandMade{"robots/t1/t1.yaml", "t1/t1.urdf"},
                                         HandMade{"robots/t1/t1_12dof.yaml", "t1/t1_12dof.urdf"},
                                         HandMade{"robots/t1/t1_23dof.yaml", "t1/t1_23dof.urdf"},
                                         HandMade{"robots/h1/h1.yaml", "h1/h1.urdf"},
                                         HandMade{"robots/h1_2/h1_2.yaml", "h1_2/h1_2.urdf"},
                                         HandMade{"robots/xbot_l/xbot_l.yaml", "xbot_l/xbot_l.urdf"},
                                         HandMade{"robots/agibot_x1/agibot_x1.yaml", "agibot_x1/agibot_x1.urdf"}),
                         [](const auto& info) { return std::filesystem::path(info.param.card).stem().string(); });

// Makers' descriptions have collision shapes, where ours have none; the base of Berkeley's is at the floor.
INSTANTIATE_TEST_SUITE_P(Shared, DraftOf,
                         testing::Values(HandMade{"controllers/arena/gr1t1.yaml", "gr1t1/GR1T1_simple.urdf", true},
                                         HandMade{"controllers/arena/gr1t2.yaml", "gr1t2/GR1T2_simple.urdf", true},
                                         HandMade{"controllers/arena/berkeley_humanoid_lite.yaml",
                                                  "berkeley_humanoid_lite/berkeley_humanoid_lite.urdf", true}),
                         [](const auto& info) { return std::filesystem::path(info.param.card).stem().string(); });

TEST(CardDraft, SaysWhatItProposesAndWhatIsMissing) {
  const std::string path = std::string(DUET_SOURCE_DIR) + "/robots/t1/t1.urdf";
  const CardDraft draft = draft_card(read_text(path), "t1.urdf", "", "t1.urdf");
  EXPECT_EQ(draft.name, "t1");
  EXPECT_SENTENCE(fmt::format("{}", fmt::join(draft.proposed, "; ")));
  EXPECT_SENTENCE(fmt::format("{}", fmt::join(draft.missing, "; ")));
  EXPECT_SENTENCE(draft.text.substr(0, draft.text.find("  - {name: Head_pitch")));
}

// Hands with fingers: what is in no limb is locked, a joint that mimics a locked one with it.
TEST(CardDraft, LocksWhatIsInNoLimb) {
  const std::string path = std::string(DUET_SOURCE_DIR) + "/robots/g1/g1_with_hand.urdf";
  const test::ScratchFolder folder;
  write_file(folder / "hands.yaml", draft_card(read_text(path), path, "hands", path).text);
  const RobotModel robot = load_robot(folder / "hands.yaml");
  EXPECT_EQ(robot.dof(), 29);
  EXPECT_EQ(robot.roles.arms[0].size(), 7U);
}

TEST(CardDraft, TakesSolesFromCollisionShapes) {
  const std::string path = std::string(DUET_SOURCE_DIR) + "/robots/t1/t1_12dof.urdf";
  std::string urdf = read_text(path);
  for (const char* foot : {"left_foot_link", "right_foot_link"})
    urdf = test::replaced(urdf, fmt::format("<link name=\"{}\">", foot),
                          fmt::format("<link name=\"{}\"><collision><origin xyz=\"0.01 0 -0.015\"/><geometry><box "
                                      "size=\"0.223 0.1 0.03\"/></geometry></collision>",
                                      foot));
  const test::ScratchFolder folder;
  write_file(folder / "t1.urdf", urdf);
  write_file(folder / "box.yaml", draft_card(urdf, "t1.urdf", "box", "t1.urdf").text);
  const RobotModel robot = load_robot(folder / "box.yaml");
  EXPECT_NEAR(robot.shapes[robot.feet[0]].X_LS.p.z(), -0.025, 1e-3);
  EXPECT_NEAR(robot.shapes[robot.feet[2]].X_LS.p.x() - robot.shapes[robot.feet[0]].X_LS.p.x(), 0.213, 1e-3);
}

// Names that YAML would read as something else, limits that the URDF lacks: what it writes is still read.
TEST(CardDraft, IsReadWhateverTheUrdfSays) {
  std::string urdf = test::kSmallUrdf;
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"name=\"shoulder\" type", "name=\"left: #1 [x]\" type"},
           {"<link name=\"base\">", "<link name=\"-base, 2\">"},
           {"<parent link=\"base\"/>", "<parent link=\"-base, 2\"/>"},
           {"lower=\"-1\" upper=\"2\" effort=\"10\" velocity=\"5\"",
            "lower=\"0\" upper=\"0\" effort=\"0\" velocity=\"0\""},
       })
    urdf = test::replaced(urdf, from, to);
  const CardDraft draft = draft_card(urdf, "odd.urdf", "", "odd robot.urdf");
  const RobotCard card = parse_card(draft.text, "odd.yaml");
  EXPECT_EQ(card.base, "-base, 2");
  EXPECT_EQ(card.urdf, "odd robot.urdf");
  EXPECT_SENTENCE(fmt::format("{}", fmt::join(draft.missing, "; ")));
}

TEST(CardDraft, RefusesWhatHasNoLimbs) {
  const auto refused = [](const std::string& urdf, const std::string& name) {
    return test::thrown_message<InputError>([&] { draft_card(urdf, "x.urdf", name, "x.urdf"); });
  };
  EXPECT_SENTENCE(refused("<robot name=\"r\"><link name=\"a\"/></robot>", ""));
  EXPECT_SENTENCE(refused(test::kSmallUrdf, "two words"));
  EXPECT_SENTENCE(refused("solid mesh", ""));
}

}  // namespace
}  // namespace duet
