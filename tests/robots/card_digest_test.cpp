#include "duet/robots/card.h"
#include "duet/robots/robot_cards.h"
#include "tests/robots/fixtures.h"

namespace duet {
namespace {

using test::kSmallCard;
using test::load_small;
using test::replaced;

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

}  // namespace
}  // namespace duet
