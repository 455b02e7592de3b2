// Cards that extend others.
#include "duet/robots/card.h"
#include "tests/robots/fixtures.h"

namespace duet {
namespace {

using test::kSmallCard;
using test::replaced;
using test::thrown_message;

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
