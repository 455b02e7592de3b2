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
  EXPECT_EQ(error("[hand]"), "c.yaml:14: robot card: 'self_collision': expected a pair of regions, found a list of 1");
  EXPECT_EQ(error("hand"), "c.yaml:14: robot card: 'self_collision': expected a pair of regions, found 'hand'");
  EXPECT_EQ(error("[hand, arm]\n  - [arm, hand]"),
            "c.yaml:15: robot card: expected each pair of regions once, found 'arm, hand' again");
  EXPECT_EQ(load_error("tracks: {rhand: tip}", "tracks: {rhand: tip}\nself_collision:\n  - [hand, amr]"),
            "small.yaml:15: 'self_collision': unknown region 'amr': did you mean 'arm'? Known: arm, hand");
}

TEST(CardErrors, Yaml) {
  EXPECT_EQ(test::thrown_message<InputError>([] { parse_card("a: [1, 2\nb: 3", "c.yaml"); }),
            "c.yaml:2: expected YAML, found: end of sequence flow not found");
  EXPECT_EQ(test::thrown_message<InputError>([] { parse_card("", "c.yaml"); }),
            "c.yaml:1: robot card: expected a mapping, found nothing");
  EXPECT_EQ(test::thrown_message<InputError>([] { parse_card("- 1\n- 2\n", "c.yaml"); }),
            "c.yaml:1: robot card: expected a mapping, found a list of 2");
}

TEST(CardErrors, Keys) {
  EXPECT_EQ(card_error("urdf:", "urfd:"),
            "c.yaml:2: robot card: unknown key 'urfd': did you mean 'urdf'? Nearest of 25: urdf, arms, name, base, "
            "legs");
  EXPECT_EQ(card_error("armature: 0.01", "armatur: 0.01"),
            "c.yaml:5: joint 'shoulder': unknown key 'armatur': did you mean 'armature'? Known: name, armature, kp, "
            "kd, neutral, lower, upper, effort, velocity");
  EXPECT_EQ(card_error("kp: 20, ", ""), "c.yaml:5: joint 'shoulder': expected the key 'kp', found none");
  EXPECT_EQ(card_error("kp: 20, ", "kp: 20, kp: 30, "),
            "c.yaml:5: joint 'shoulder': expected each key once, found 'kp' again");
  EXPECT_EQ(card_error("name: small", "? [1, 2]\n: 3\nname: small"),
            "c.yaml:1: robot card: expected a plain key, found a list of 2");
  EXPECT_EQ(card_error("tracks: {rhand: tip}", "tracks: {right_hand: tip}"),
            "c.yaml:13: tracks: unknown key 'right_hand'. Known: head, lhand, rhand, torso, lshoulder, rshoulder");
}

TEST(CardErrors, Values) {
  EXPECT_EQ(card_error("base: base", "base:"), "c.yaml:3: robot card: 'base': expected a text, found nothing");
  EXPECT_EQ(card_error("kp: 20", "kp: .nan"),
            "c.yaml:5: joint 'shoulder': 'kp': expected a finite number, found '.nan'");
  EXPECT_EQ(card_error("kp: 20", "kp: 20 Nm"),
            "c.yaml:5: joint 'shoulder': 'kp': expected a finite number, found '20 Nm'");
  EXPECT_EQ(card_error("kp: 20", "kp: -20"), "c.yaml:5: joint 'shoulder': 'kp': expected a number >= 0, found -20");
  EXPECT_EQ(card_error("kd: 1,", "kd: [1],"),
            "c.yaml:5: joint 'shoulder': 'kd': expected a finite number, found a list of 1");
  EXPECT_EQ(card_error("armature: 0.01", "armature: -0.01"),
            "c.yaml:5: joint 'shoulder': 'armature': expected a number >= 0, found -0.01");
  EXPECT_EQ(card_error("neutral: 0.5", "effort: 0"),
            "c.yaml:5: joint 'shoulder': 'effort': expected a number > 0, found 0");
  EXPECT_EQ(card_error("neutral: 0.5", "velocity: -1"),
            "c.yaml:5: joint 'shoulder': 'velocity': expected a number > 0, found -1");
  EXPECT_EQ(card_error("xyz: [0, 0, -0.2]", "xyz: [0, -0.2]"),
            "c.yaml:8: frame 'tip': 'xyz': expected three numbers, found a list of 2");
  EXPECT_EQ(card_error("xyz: [0, 0, -0.2]", "xyz: [0, 0, .inf]"),
            "c.yaml:8: frame 'tip': 'xyz': expected a finite number, found '.inf'");
  EXPECT_EQ(card_error("sole: true", "sole: maybe"), "c.yaml:16: shape: 'sole': expected true or false, found 'maybe'");
  EXPECT_EQ(card_error("smpl: right_hand", "smpl: rigth_hand"),
            "c.yaml:12: keypoint 'hand': unknown SMPL joint 'rigth_hand': did you mean 'right_hand'? Known: pelvis, "
            "left_hip, right_hip, spine1, left_knee, right_knee, spine2, left_ankle, right_ankle, spine3, left_toe, "
            "right_toe, neck, left_collar, right_collar, head, left_shoulder, right_shoulder, left_elbow, right_elbow, "
            "left_wrist, right_wrist, left_hand, right_hand");
  EXPECT_EQ(card_error("tracks: {rhand: tip}", "tracks: [tip]"),
            "c.yaml:13: tracks: expected a mapping, found a list of 1");
  EXPECT_EQ(card_error("pairs:\n  - {frame: base, smpl: pelvis}", "pairs: none"),
            "c.yaml:9: robot card: 'pairs': expected a list, found 'none'");
}

TEST(CardErrors, Shapes) {
  EXPECT_EQ(card_error("kind: sphere", "kind: box"),
            "c.yaml:16: shape: 'kind': expected sphere or capsule, found 'box'");
  EXPECT_EQ(card_error("from: [0, 0, 0], to", "to"),
            "c.yaml:15: shape: expected 'from' and 'to' alone for a capsule, found no 'from'");
  EXPECT_EQ(card_error("kind: sphere", "kind: capsule"),
            "c.yaml:16: shape: expected 'from' and 'to' alone for a capsule, found also 'center'");
  EXPECT_EQ(card_error("to: [0.1, 0, 0]", "to: [0, 0, 0]"),
            "c.yaml:15: shape: expected two different ends of the capsule, found the same point");
  EXPECT_EQ(card_error("radius: 0.03", "radius: 0"), "c.yaml:16: shape: 'radius': expected a number > 0, found 0");
  EXPECT_EQ(card_error(", region: arm", ""), "c.yaml:15: shape: expected the key 'region', found none");
}

TEST(CardErrors, Repeats) {
  EXPECT_EQ(card_error("name: elbow", "name: shoulder"),
            "c.yaml:6: robot card: expected each joint once, found 'shoulder' again");
  EXPECT_EQ(card_error("frames:\n", "frames:\n  - {name: tip, link: base, xyz: [0, 0, 0]}\n"),
            "c.yaml:9: robot card: expected each frame once, found 'tip' again");
  EXPECT_EQ(card_error("keypoints:\n", "keypoints:\n  - {name: hand, frame: base, smpl: head}\n"),
            "c.yaml:13: robot card: expected each keypoint once, found 'hand' again");
  EXPECT_EQ(card_error("frames:\n", "locked:\n  - {name: x, position: 0}\n  - {name: x, position: 1}\nframes:\n"),
            "c.yaml:9: robot card: expected each locked joint once, found 'x' again");
}

TEST(CardErrors, AgainstTheUrdf) {
  EXPECT_EQ(load_error("base: base", "base: bas"),
            "small.yaml:3: 'base' with small.urdf: unknown link 'bas': did you mean 'base'? Known: base, upper, brick, "
            "lower");
  EXPECT_EQ(load_error("base: base", "base: upper"),
            "small.yaml:3: 'base': expected the root link of small.urdf, 'base', found 'upper'");
  EXPECT_EQ(load_error("name: elbow", "name: elbo"),
            "small.yaml:6: with small.urdf: unknown joint 'elbo': did you mean 'elbow'? Known: shoulder, elbow");
  EXPECT_EQ(load_error("  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}\n", ""),
            "small.yaml: expected every joint of small.urdf in 'joints' or 'locked', found none for: elbow");
  EXPECT_EQ(load_error("frames:\n", "locked:\n  - {name: elbow, position: 0}\nframes:\n"),
            "small.yaml:6: joint 'elbow': expected it in 'joints' or in 'locked', found it in both");
  EXPECT_EQ(load_error("frames:\n", "locked:\n  - {name: wrist, position: 0}\nframes:\n"),
            "small.yaml:8: with small.urdf: unknown joint 'wrist'. Known: shoulder, elbow");
  EXPECT_EQ(
      load_error("link: lower, xyz", "link: lowe, xyz"),
      "small.yaml:8: with small.urdf: unknown link 'lowe': did you mean 'lower'? Known: base, upper, brick, lower");
  EXPECT_EQ(load_error("name: tip", "name: brick"),
            "small.yaml:8: frame 'brick': expected a name that small.urdf does not use (or replaces_urdf_link: true), "
            "found the name of one of its links");
  EXPECT_EQ(
      load_error("link: brick, kind", "link: brik, kind"),
      "small.yaml:15: with small.urdf: unknown link 'brik': did you mean 'brick'? Known: base, upper, brick, lower");
  EXPECT_EQ(load_error("frame: tip", "frame: tp"),
            "small.yaml:12: unknown frame 'tp': did you mean 'tip'? Known: base, upper, brick, lower, tip");
}

TEST(CardErrors, OrderAndRanges) {
  const std::string shoulder = "  - {name: shoulder, armature: 0.01, kp: 20, kd: 1, neutral: 0.5}\n";
  const std::string elbow = "  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}\n";
  EXPECT_EQ(load_error(shoulder + elbow, elbow + shoulder),
            "small.yaml:5: joint 'elbow': expected it after its parent joint 'shoulder'");
  EXPECT_EQ(load_error("neutral: 0.5", "neutral: 2.5"),
            "joint 'shoulder' of small.urdf and small.yaml:5: expected a neutral angle in [-1, 2], found 2.5");
  EXPECT_EQ(load_error("neutral: 0.5", "lower: 2"),
            "joint 'shoulder' of small.urdf and small.yaml:5: expected lower < upper, found [2, 2]");
  EXPECT_EQ(load_error("neutral: 0.5", "neutral: 0.5", replaced(kSmallUrdf, "effort=\"10\"", "effort=\"0\"")),
            "joint 'shoulder' of small.urdf and small.yaml:5: expected an effort limit > 0, found 0");
  EXPECT_EQ(load_error("neutral: 0.5", "neutral: 0.5", replaced(kSmallUrdf, "velocity=\"5\"", "velocity=\"0\"")),
            "joint 'shoulder' of small.urdf and small.yaml:5: expected a velocity limit > 0, found 0");
  EXPECT_EQ(
      load_error(elbow, "locked:\n  - {name: elbow, position: 9}\n"),
      "small.yaml:7: locked joint 'elbow': expected a position in [-6.283185307179586, 6.283185307179586], found 9");
}

TEST(CardErrors, JointsAndLinksThatCannotBe) {
  const std::string sliding = replaced(kSmallUrdf, "type=\"continuous\"", "type=\"prismatic\"");
  EXPECT_EQ(load_error("neutral: 0.5", "neutral: 0.5", sliding),
            "small.urdf: joint 'elbow': expected revolute, continuous or fixed, found prismatic");
  const std::string floating = replaced(kSmallUrdf, "type=\"continuous\"", "type=\"floating\"");
  EXPECT_EQ(load_error("  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}\n",
                       "locked:\n  - {name: elbow, position: 0}\n", floating),
            "small.urdf: joint 'elbow': expected one that can be locked, found floating");
  EXPECT_EQ(
      load_error("neutral: 0.5", "neutral: 0.5", replaced(kSmallUrdf, "<mass value=\"0.5\"/>", "<mass value=\"0\"/>")),
      "small.urdf: link 'lower': expected a mass > 0 with its fixed parts, found 0");
  EXPECT_EQ(
      load_error("neutral: 0.5", "neutral: 0.5",
                 replaced(kSmallUrdf, "ixx=\"0.001\" iyy=\"0.001\" izz=\"0.001\"", "ixx=\"0\" iyy=\"0\" izz=\"0\"")),
      "small.urdf: link 'lower': expected a positive definite inertia with its fixed parts, found a principal moment "
      "of 0");
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
