#include "duet/robots/card.h"

#include "duet/robots/robot_cards.h"
#include "tests/robots/fixtures.h"

namespace duet {
namespace {

using test::kSmallCard;
using test::kSmallUrdf;
using test::load_small;
using test::replaced;
using test::thrown_message;

// The error of parsing the small card after `from` became `to`; the file is called c.yaml.
std::string card_error(const std::string& from, const std::string& to) {
  return test::thrown_message<InputError>([&] { parse_card(replaced(kSmallCard, from, to), "c.yaml"); });
}

// The error of loading it, without the folders.
std::string load_error(const std::string& from, const std::string& to, const std::string& urdf = kSmallUrdf) {
  std::string message = test::load_error(replaced(kSmallCard, from, to), urdf);
  for (size_t slash = message.rfind("/small."); slash != std::string::npos; slash = message.rfind("/small.")) {
    const size_t start = message.rfind(' ', slash);
    message.erase(start == std::string::npos ? 0 : start + 1, slash - (start == std::string::npos ? 0 : start + 1) + 1);
  }
  return message;
}

TEST(Card, ReadsEveryKey) {
  const RobotCard card = parse_card(kSmallCard, "c.yaml");
  EXPECT_EQ(card.name, "small");
  EXPECT_EQ(card.urdf, "small.urdf");
  EXPECT_EQ(card.base, "base");
  ASSERT_EQ(card.joints.size(), 2u);
  EXPECT_EQ(card.joints[0].neutral, 0.5);
  EXPECT_EQ(card.joints[1].neutral, 0.0);
  EXPECT_EQ(card.joints[1].place.line, 6);
  EXPECT_EQ(card.frames[0].link, "lower");
  EXPECT_EQ(card.pairs[0].smpl, 0);
  EXPECT_EQ(card.keypoints[0].smpl, 23);
  EXPECT_EQ(card.tracks[0].frame, "tip");
  EXPECT_EQ(card.shapes[0].kind, ShapeKind::kCapsule);
  EXPECT_TRUE(card.shapes[1].sole);
}

TEST(Card, OverridesTheUrdfsLimits) {
  const RobotModel model = test::load_small(
      replaced(kSmallCard, "neutral: 0.5}", "neutral: 0.5, lower: -0.5, upper: 0.75, effort: 3, velocity: 4}"));
  EXPECT_EQ(model.joints[0].lower, -0.5);
  EXPECT_EQ(model.joints[0].upper, 0.75);
  EXPECT_EQ(model.joints[0].effort, 3.0);
  EXPECT_EQ(model.joints[0].velocity, 4.0);
  EXPECT_EQ(model.joints[1].effort, 7.0);
}

TEST(Card, CapsuleLiesBetweenItsEnds) {
  const RobotModel model = test::load_small();
  const RobotShape& capsule = model.shapes[0];
  EXPECT_EQ(capsule.link, 1);  // the brick is a part of the upper link
  EXPECT_NEAR(capsule.half_length, 0.05, 1e-15);
  const Pose X_LBrick = model.frames[model.frame_index("brick")].X_LF;
  const Eigen::Vector3d top = capsule.X_LS * Eigen::Vector3d(0, 0, capsule.half_length);
  EXPECT_LT((top - X_LBrick * Eigen::Vector3d(0.1, 0, 0)).norm(), 1e-15);
}

TEST(Card, SolesGiveTheStandingHeight) {
  const std::string upright = replaced(kSmallCard, "neutral: 0.5", "neutral: 0");
  const std::string urdf = replaced(kSmallUrdf, " rpy=\"0.1 0.2 0.3\"", "");
  // shoulder +0.3, brick -0.2, elbow -0.1, sphere's centre -0.2, radius 0.03
  EXPECT_NEAR(test::load_small(upright, urdf).standing_height, 0.23, 1e-15);
  EXPECT_EQ(test::load_small(replaced(kSmallCard, ", sole: true", "")).standing_height, 0.0);
}

TEST(Card, CapsuleCanBeASole) {
  const std::string card =
      replaced(replaced(kSmallCard, "neutral: 0.5", "neutral: 0"), "kind: sphere, center: [0, 0, -0.2]",
               "kind: capsule, from: [0, 0, -0.1], to: [0, 0, -0.2]");
  EXPECT_NEAR(test::load_small(card, replaced(kSmallUrdf, " rpy=\"0.1 0.2 0.3\"", "")).standing_height, 0.23, 1e-15);
}

// A chain of hinges with a sphere on every link but the base: links c0 to c5, regions "low" (c0, c1) and "high" (c4,
// c5).
std::string chain_urdf() {
  std::string text = R"(<robot name="chain"><link name="base">)";
  const std::string body = R"(<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>)"
                           "</inertial></link>";
  text += body;
  for (int i = 0; i < 6; ++i)
    text += fmt::format(
                R"(<joint name="j{0}" type="revolute"><parent link="{1}"/><child link="c{0}"/><origin xyz="0 0 1"/>)"
                R"(<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint><link name="c{0}">)",
                i, i == 0 ? "base" : fmt::format("c{}", i - 1)) +
            body;
  return text + "</robot>";
}

std::string chain_card(const std::string& pairs) {
  std::string text = "name: chain\nurdf: small.urdf\nbase: base\njoints:\n";
  for (int i = 0; i < 6; ++i) text += fmt::format("  - {{name: j{}, armature: 0, kp: 0, kd: 0}}\n", i);
  text += "shapes:\n";
  for (const int i : {5, 0, 1, 4})
    text += fmt::format("  - {{link: c{}, kind: sphere, center: [0, 0, 0], radius: 0.1, region: {}}}\n", i,
                        i < 2 ? "low" : "high");
  return text + "self_collision:\n" + pairs;
}

TEST(Card, SelfCollisionTakesShapesThatMoreThanThreeJointsJoin) {
  using Pairs = std::vector<std::pair<int, int>>;
  const auto pairs = [](const std::string& text) {
    return test::load_small(chain_card(text), chain_urdf()).self_collision;
  };
  // c5 is shape 0, c0 1, c1 2, c4 3; c1 and c4 are three joints apart.
  const Pairs expected = {{0, 1}, {0, 2}, {1, 3}};
  EXPECT_EQ(pairs("  - [low, high]\n"), expected);
  EXPECT_EQ(pairs("  - [high, low]\n"), expected);
  EXPECT_EQ(pairs("  - [high, high]\n  - [low, low]\n"), Pairs());
  EXPECT_EQ(test::load_small().self_collision, Pairs());
}

TEST(CardErrors, SelfCollision) {
  const auto error = [](const std::string& pair) {
    return card_error("tracks: {rhand: tip}", "self_collision:\n  - " + pair + "\ntracks: {rhand: tip}");
  };
  for (const char* text : {"[hand]", "hand", "[hand, arm]\n  - [arm, hand]"}) EXPECT_SENTENCE(error(text));
  EXPECT_SENTENCE(load_error("tracks: {rhand: tip}", "tracks: {rhand: tip}\nself_collision:\n  - [hand, amr]"));
}

TEST(CardErrors, Yaml) {
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { parse_card("a: [1, 2\nb: 3", "c.yaml"); }));
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { parse_card("", "c.yaml"); }));
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { parse_card("- 1\n- 2\n", "c.yaml"); }));
}

TEST(CardErrors, Keys) {
  EXPECT_SENTENCE(card_error("urdf:", "urfd:"));
  EXPECT_SENTENCE(card_error("armature: 0.01", "armatur: 0.01"));
  EXPECT_SENTENCE(card_error("kp: 20, ", ""));
  EXPECT_SENTENCE(card_error("kp: 20, ", "kp: 20, kp: 30, "));
  EXPECT_SENTENCE(card_error("name: small", "? [1, 2]\n: 3\nname: small"));
  EXPECT_SENTENCE(card_error("tracks: {rhand: tip}", "tracks: {right_hand: tip}"));
}

TEST(CardErrors, Values) {
  EXPECT_SENTENCE(card_error("base: base", "base:"));
  EXPECT_SENTENCE(card_error("kp: 20", "kp: .nan"));
  EXPECT_SENTENCE(card_error("kp: 20", "kp: 20 Nm"));
  EXPECT_SENTENCE(card_error("kp: 20", "kp: -20"));
  EXPECT_SENTENCE(card_error("kd: 1,", "kd: [1],"));
  EXPECT_SENTENCE(card_error("armature: 0.01", "armature: -0.01"));
  EXPECT_SENTENCE(card_error("neutral: 0.5", "effort: 0"));
  EXPECT_SENTENCE(card_error("neutral: 0.5", "velocity: -1"));
  EXPECT_SENTENCE(card_error("xyz: [0, 0, -0.2]", "xyz: [0, -0.2]"));
  EXPECT_SENTENCE(card_error("xyz: [0, 0, -0.2]", "xyz: [0, 0, .inf]"));
  EXPECT_SENTENCE(card_error("sole: true", "sole: maybe"));
  EXPECT_SENTENCE(card_error("smpl: right_hand", "smpl: rigth_hand"));
  EXPECT_SENTENCE(card_error("tracks: {rhand: tip}", "tracks: [tip]"));
  EXPECT_SENTENCE(card_error("pairs:\n  - {frame: base, smpl: pelvis}", "pairs: none"));
}

TEST(CardErrors, Shapes) {
  EXPECT_SENTENCE(card_error("kind: sphere", "kind: box"));
  EXPECT_SENTENCE(card_error("from: [0, 0, 0], to", "to"));
  EXPECT_SENTENCE(card_error("kind: sphere", "kind: capsule"));
  EXPECT_SENTENCE(card_error("to: [0.1, 0, 0]", "to: [0, 0, 0]"));
  EXPECT_SENTENCE(card_error("radius: 0.03", "radius: 0"));
  EXPECT_SENTENCE(card_error(", region: arm", ""));
}

TEST(CardErrors, Repeats) {
  EXPECT_SENTENCE(card_error("name: elbow", "name: shoulder"));
  EXPECT_SENTENCE(card_error("frames:\n", "frames:\n  - {name: tip, link: base, xyz: [0, 0, 0]}\n"));
  EXPECT_SENTENCE(card_error("keypoints:\n", "keypoints:\n  - {name: hand, frame: base, smpl: head}\n"));
  EXPECT_SENTENCE(
      card_error("frames:\n", "locked:\n  - {name: x, position: 0}\n  - {name: x, position: 1}\nframes:\n"));
}

TEST(CardErrors, AgainstTheUrdf) {
  EXPECT_SENTENCE(load_error("base: base", "base: bas"));
  EXPECT_SENTENCE(load_error("base: base", "base: upper"));
  EXPECT_SENTENCE(load_error("name: elbow", "name: elbo"));
  EXPECT_SENTENCE(load_error("  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}\n", ""));
  EXPECT_SENTENCE(load_error("frames:\n", "locked:\n  - {name: elbow, position: 0}\nframes:\n"));
  EXPECT_SENTENCE(load_error("frames:\n", "locked:\n  - {name: wrist, position: 0}\nframes:\n"));
  EXPECT_SENTENCE(load_error("link: lower, xyz", "link: lowe, xyz"));
  EXPECT_SENTENCE(load_error("name: tip", "name: brick"));
  EXPECT_SENTENCE(load_error("link: brick, kind", "link: brik, kind"));
  EXPECT_SENTENCE(load_error("frame: tip", "frame: tp"));
}

TEST(CardErrors, OrderAndRanges) {
  const std::string shoulder = "  - {name: shoulder, armature: 0.01, kp: 20, kd: 1, neutral: 0.5}\n";
  const std::string elbow = "  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}\n";
  EXPECT_SENTENCE(load_error(shoulder + elbow, elbow + shoulder));
  EXPECT_SENTENCE(load_error("neutral: 0.5", "neutral: 2.5"));
  EXPECT_SENTENCE(load_error("neutral: 0.5", "lower: 2"));
  EXPECT_SENTENCE(load_error("neutral: 0.5", "neutral: 0.5", replaced(kSmallUrdf, "effort=\"10\"", "effort=\"0\"")));
  EXPECT_SENTENCE(load_error("neutral: 0.5", "neutral: 0.5", replaced(kSmallUrdf, "velocity=\"5\"", "velocity=\"0\"")));
  EXPECT_SENTENCE(load_error(elbow, "locked:\n  - {name: elbow, position: 9}\n"));
}

TEST(CardErrors, JointsAndLinksThatCannotBe) {
  const std::string sliding = replaced(kSmallUrdf, "type=\"continuous\"", "type=\"prismatic\"");
  EXPECT_SENTENCE(load_error("neutral: 0.5", "neutral: 0.5", sliding));
  const std::string floating = replaced(kSmallUrdf, "type=\"continuous\"", "type=\"floating\"");
  EXPECT_SENTENCE(load_error("  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}\n",
                             "locked:\n  - {name: elbow, position: 0}\n", floating));
  EXPECT_SENTENCE(
      load_error("neutral: 0.5", "neutral: 0.5", replaced(kSmallUrdf, "<mass value=\"0.5\"/>", "<mass value=\"0\"/>")));
  EXPECT_SENTENCE(
      load_error("neutral: 0.5", "neutral: 0.5",
                 replaced(kSmallUrdf, "ixx=\"0.001\" iyy=\"0.001\" izz=\"0.001\"", "ixx=\"0\" iyy=\"0\" izz=\"0\"")));
}

// A prismatic joint that the card locks is a rigid offset along its axis.
TEST(Card, LockedSlideIsAnOffset) {
  const std::string sliding = replaced(replaced(kSmallUrdf, "type=\"continuous\"", "type=\"prismatic\""),
                                       "<limit effort=\"7\"", "<limit lower=\"0\" upper=\"0.1\" effort=\"7\"");
  const RobotModel model = test::load_small(replaced(kSmallCard, "  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}\n",
                                                     "locked:\n  - {name: elbow, position: 0.1}\n"),
                                            sliding);
  const Pose X_brick_lower =
      model.frames[model.frame_index("brick")].X_LF.inverse() * model.frames[model.frame_index("lower")].X_LF;
  EXPECT_LT((X_brick_lower.p - Eigen::Vector3d(0.1 / std::sqrt(2.0), 0.1 / std::sqrt(2.0), -0.1)).norm(), 1e-15);
}

// Digests of URDF and card, byte by byte, as they were when rows were published under them.
constexpr std::pair<const char*, const char*> kPublishedDigests[] = {
    {"g1", "b22cde7449b8de81c5bb67eb826ea8dddc87783671befcad2c40d80e1b44af7b"},
    {"g1_12dof", "a973fe9e6231e92af5ed4d7f964a4ebea7c0eccbc5b491f2624da4d0902c20ab"},
    {"g1_27dof", "af0aa4f47abb05dd0c61ca8a1146d8bca28e240a727e66c5b05f13df780b2845"},
    {"g1_playground", "57bdbfda72094abe6364700628b71638ea92df71d477ba71c6f24046917ca788"},
    {"g1_twist2", "f5a01d41e2755e19a38604e36e60ff9cbb6dfc7d88870508ad1dde14828c264f"}};

TEST(RobotDigest, OfPublishedCardsIsThePublishedOne) {
  for (const auto& [name, digest] : kPublishedDigests) {
    EXPECT_EQ(load_robot(card_path(name)).digest, digest) << name;
    const auto robot = robot_of_digest(digest);
    ASSERT_NE(robot, nullptr);
    EXPECT_EQ(robot->name, name);
  }
}

TEST(RobotDigest, IsOfWhatACardSaysAndNotOfHowItIsWritten) {
  const std::string digest = load_small().digest;
  EXPECT_EQ(digest.size(), 64u);
  EXPECT_EQ(load_small(kSmallCard + "# a comment\n").digest, digest);
  EXPECT_EQ(load_small(replaced(kSmallCard, "kp: 20,", "kp: 2.0e1,")).digest, digest);
  EXPECT_EQ(load_small(replaced(kSmallCard, "armature: 0.01, kp: 20,", "kp: 20, armature: 0.01,")).digest, digest);
  EXPECT_EQ(load_small(replaced(kSmallCard, "name: small\nurdf: small.urdf", "urdf: small.urdf\nname: small")).digest,
            digest);
  const std::string spread = replaced(kSmallCard, "tracks: {rhand: tip}\n", "");
  const test::ScratchFolder folder;
  write_file(folder / "base.yaml", replaced(spread, "kp: 20", "kp: 21"));
  write_file(folder / "small.urdf", test::kSmallUrdf);
  write_file(folder / "small.yaml", R"(name: small
extends: base.yaml
tracks: {rhand: tip}
joints:
  - {name: shoulder, armature: 0.01, kp: 20, kd: 1, neutral: 0.5}
  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}
)");
  EXPECT_EQ(load_robot(folder / "small.yaml").digest, digest);
}

TEST(RobotDigest, TellsWhatCardsSayApart) {
  const std::string digest = load_small().digest;
  for (const auto& [from, to] : std::initializer_list<std::pair<std::string, std::string>>{
           {"kp: 20,", "kp: 21,"},
           {"name: small", "name: other"},
           {"radius: 0.02, region: arm", "radius: 0.02, region: forearm"},
           {"tracks: {rhand: tip}", "tracks: {lhand: tip}"},
           {"tracks: {rhand: tip}", "tracks: {rhand: tip}\nfall: {height: 0.1, cos_tilt: 0.5}"}})
    EXPECT_NE(load_small(replaced(kSmallCard, from, to)).digest, digest) << to;
  EXPECT_NE(load_small(kSmallCard, test::kSmallUrdf + "\n").digest, digest);
}

TEST(RobotDigest, ListsAndMappingsOfTheSameWordsAreOthers) {
  const auto content = [](const char* text) { return content_of(YAML::Load(text)).at("x"); };
  EXPECT_NE(content("x: [a, b]"), content("x: [ab]"));
  EXPECT_NE(content("x: [[a], b]"), content("x: [a, [b]]"));
  EXPECT_NE(content("x: {a: b}"), content("x: [a, b]"));
  EXPECT_NE(content("x: {a: 1}"), content("x: {a: -1}"));
  EXPECT_EQ(content("x: {a: 1, b: 2}"), content("x: {b: 2.0, a: 1}"));
}

// Cards that extend others.

// Folders of cards: the small robot in base/, and what a test adds.
class CardExtends : public ::testing::Test {
 protected:
  CardExtends() {
    write_file(folder_ / "base/small.yaml", kSmallCard);
    write_file(folder_ / "base/small.urdf", test::kSmallUrdf);
  }
  std::string add(const std::string& file, const std::string& text) {
    write_file(folder_ / file, text);
    return folder_ / file;
  }
  std::string error(const std::string& card) {
    return thrown_message<InputError>([&] { load_robot(card); });
  }

  test::ScratchFolder folder_;
};

TEST_F(CardExtends, OnlyTheKeysGivenReplaceTheOnesExtended) {
  const std::string card = add("base/stiff.yaml", R"(name: stiff
extends: small.yaml
joints:
  - {name: shoulder, armature: 0.5, kp: 70, kd: 7}
  - {name: elbow, armature: 0.5, kp: 80, kd: 8}
)");
  const RobotModel stiff = load_robot(card), small = load_robot(folder_ / "base/small.yaml");
  EXPECT_EQ(stiff.name, "stiff");
  EXPECT_EQ(stiff.joints[0].kp, 70.0);
  EXPECT_EQ(stiff.neutral, Eigen::Vector2d::Zero());
  EXPECT_EQ(stiff.total_mass(), small.total_mass());
  EXPECT_EQ(stiff.shapes.size(), small.shapes.size());
  EXPECT_EQ(stiff.keypoints.size(), small.keypoints.size());
  EXPECT_NE(stiff.digest, small.digest);
}

TEST_F(CardExtends, TheUrdfOfAnotherFolderIsFound) {
  const std::string card = add("other/deep/far.yaml", "name: far\nextends: ../../base/small.yaml\n");
  EXPECT_EQ(parse_card(read_text(card), card).urdf, "../../base/small.urdf");
  EXPECT_EQ(load_robot(card).dof(), 2);
  EXPECT_EQ(
      parse_card(read_text(card), card).files,
      (std::vector<std::string>{
          card, (std::filesystem::path(card).parent_path() / "../../base/small.yaml").lexically_normal().string()}));
}

TEST_F(CardExtends, GoesOverSeveralCards) {
  add("base/b.yaml", "name: b\nextends: small.yaml\ntracks: {head: tip}\n");
  const std::string c = add("base/c.yaml", "name: c\nextends: b.yaml\npairs: []\n");
  const RobotModel model = load_robot(c);
  EXPECT_EQ(model.name, "c");
  EXPECT_EQ(model.tracks.count("head"), 1u);
  EXPECT_EQ(model.tracks.count("rhand"), 0u);
  EXPECT_TRUE(model.pairs.empty());
}

TEST_F(CardExtends, AFaultOfTheCardExtendedNamesItsFileAndLine) {
  add("base/broken.yaml", replaced(kSmallCard, "kp: 20", "kp: stiff"));
  EXPECT_EQ(error(add("base/mine.yaml", "name: mine\nextends: broken.yaml\n")),
            folder_ / "base/broken.yaml" +
                ":5: joint 'shoulder': key 'kp': expected a finite number, zero or more, found 'stiff'");
  // A fault that the card itself makes in what it extends is told at the place of the latter.
  EXPECT_SENTENCE(error(add("base/less.yaml", R"(name: less
extends: small.yaml
locked: [{name: elbow, position: 0}]
)")));
}

TEST_F(CardExtends, ACycleNamesBothFiles) {
  add("base/a.yaml", "name: a\nextends: b.yaml\n");
  add("base/b.yaml", "name: b\nextends: a.yaml\n");
  EXPECT_EQ(error(folder_ / "base/a.yaml"),
            folder_ / "base/b.yaml" + ":2: robot card: key 'extends': expected cards without a cycle, found " +
                (folder_ / "base/a.yaml") + ", which extends " + (folder_ / "base/b.yaml"));
  EXPECT_SENTENCE(error(add("base/self.yaml", "name: self\nextends: self.yaml\n")));
}

TEST_F(CardExtends, ARowIsEightCardsLongAtMost) {
  std::string last = "small.yaml";
  for (int i = 1; i <= kMostExtended; ++i) {
    const std::string name = fmt::format("c{}", i);
    add("base/" + name + ".yaml", fmt::format("name: {}\nextends: {}\n", name, last));
    last = name + ".yaml";
  }
  EXPECT_EQ(load_robot(folder_ / ("base/" + last)).dof(), 2);
  EXPECT_SENTENCE(error(add("base/more.yaml", "name: more\nextends: " + last + "\n")));
}

TEST_F(CardExtends, IsARelativePathOfACard) {
  for (const char* path : {"/etc/hosts.yaml", "small.txt", "g1"})
    EXPECT_SENTENCE(error(add("base/mine.yaml", fmt::format("name: mine\nextends: {}\n", path))));
  EXPECT_SENTENCE(error(add("base/mine.yaml", "name: mine\nextends: none.yaml\n")));
}

TEST_F(CardExtends, ACardHasItsOwnName) { EXPECT_SENTENCE(error(add("base/mine.yaml", "extends: small.yaml\n"))); }

}  // namespace
}  // namespace duet
