#include "duet/robots/card.h"

#include "tests/robots/fixtures.h"

namespace duet {
namespace {

using test::kSmallCard;
using test::kSmallUrdf;
using test::replaced;

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

}  // namespace
}  // namespace duet
