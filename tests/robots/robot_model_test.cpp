#include "duet/robots/robot_model.h"

#include <cstdlib>
#include <filesystem>
#include <thread>

#include "duet/core/share.h"
#include "duet/robots/robot_cards.h"
#include "tests/robots/fixtures.h"

namespace duet {
namespace {

using test::g1;
using test::thrown_message;

TEST(RobotModel, FindsNamesAndRefusesOthers) {
  EXPECT_EQ(g1().joint_index("left_knee_joint"), 3);
  EXPECT_EQ(g1().frames[g1().frame_index("pelvis")].link, 0);
  EXPECT_EQ(g1().keypoints[g1().keypoint_index("right_hand")].name, "right_hand");
  EXPECT_EQ(g1().track_frame("head"), g1().frame_index("head_link"));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { static_cast<void>(g1().joint_index("left_kne_joint")); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { static_cast<void>(g1().frame_index("pelvi")); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { static_cast<void>(g1().keypoint_index("left_wris")); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { static_cast<void>(g1().track_frame("trso")); }));
}

TEST(RobotModel, VectorsFollowTheJoints) {
  const RobotModel model = test::load_small();
  EXPECT_EQ(model.joint_names(), (std::vector<std::string>{"shoulder", "elbow"}));
  EXPECT_EQ(model.lower()[0], -1.0);
  EXPECT_EQ(model.upper()[0], 2.0);
  EXPECT_EQ(model.neutral, Eigen::Vector2d(0.5, 0.0));
}

TEST(RobotModel, StandsAtAPlaceWithItsHeading) {
  const Pose X{yaw_rotation(0.8) * Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX())), {1, 2, 9}};
  const RobotState state = g1().standing_state(X);
  EXPECT_NEAR(yaw_of(state.X_WB.R), 0.8, 1e-15);
  EXPECT_LT((state.X_WB.R * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm(), 1e-15);
  EXPECT_EQ(state.X_WB.p, Eigen::Vector3d(1, 2, g1().standing_height));
  EXPECT_EQ(state.q, g1().neutral);
  EXPECT_EQ(state.v, Eigen::VectorXd::Zero(29));
  EXPECT_EQ(state.v_WB.norm() + state.w_WB_B.norm(), 0.0);
}

TEST(RobotModel, DefaultCommandCarriesTheCardsGains) {
  const JointCommand command = g1().default_command(g1().neutral);
  EXPECT_EQ(command.q_target, g1().neutral);
  for (int j = 0; j < 29; ++j) {
    EXPECT_EQ(command.kp[j], g1().joints[j].kp);
    EXPECT_EQ(command.kd[j], g1().joints[j].kd);
  }
  EXPECT_EQ(command.tau_ff, Eigen::VectorXd::Zero(29));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>(
      [] { static_cast<void>(g1().default_command(Eigen::VectorXd::Zero(12))); }));
}

TEST(RobotModel, FallsBelowItsCardsHeightOrBeyondItsTilt) {
  const FallRule rule{0.45, 0.7};
  RobotState state;
  state.X_WB.p.z() = 0.75;
  EXPECT_FALSE(has_fallen(state, rule));
  state.X_WB.p.z() = 0.44;
  EXPECT_TRUE(has_fallen(state, rule));
  EXPECT_FALSE(has_fallen(state, {0.38, 0.7}));
  state.X_WB.p.z() = 0.75;
  state.X_WB.R = Eigen::AngleAxisd(std::acos(0.7) + 1e-6, Eigen::Vector3d::UnitX());
  EXPECT_TRUE(has_fallen(state, rule));
}

TEST(RobotModel, WhatWasMadeForAnotherIsRefusedByName) {
  EXPECT_SENTENCE(thrown_message<InputError>([] { require_made_for("t1", g1(), "weights.safetensors"); }));
  EXPECT_NO_THROW(require_made_for("g1", g1(), ""));
}

TEST(LoadRobot, UrdfByPathReplacesTheCards) {
  const test::ScratchFolder folder;
  write_file(folder / "card.yaml", test::replaced(test::kSmallCard, "small.urdf", "absent.urdf"));
  write_file(folder / "other.urdf", test::kSmallUrdf);
  EXPECT_EQ(load_robot(folder / "card.yaml", folder / "other.urdf").dof(), 2);
  EXPECT_EQ(thrown_message<MissingError>([&] { load_robot(folder / "card.yaml"); }),
            folder / "card.yaml" +
                ": the description 'absent.urdf' is absent (it is looked for beside the card, in $DUET_MODELS and in "
                "$DUET_SHARED/models and $DUET_SHARED/arena)");
  EXPECT_EQ(thrown_message<InputError>([&] { load_robot(folder / "no.yaml"); }),
            "cannot read '" + folder / "no.yaml" + "': No such file or directory");
}

// urdfdom's message handler is one per process; loading must not race on it.
TEST(LoadRobot, IsThreadSafe) {
  std::vector<std::string> digests(4);
  std::vector<std::thread> threads;
  for (std::string& digest : digests) threads.emplace_back([&digest] { digest = load_robot(test::g1_card()).digest; });
  for (std::thread& thread : threads) thread.join();
  for (const std::string& digest : digests) EXPECT_EQ(digest, g1().digest);
}

TEST(DefaultCard, IsTheSourceTreesUnlessDuetShareHasOne) {
  unsetenv("DUET_SHARE");
  EXPECT_EQ(default_card_path(), test::g1_card());
  const test::ScratchFolder folder;
  setenv("DUET_SHARE", (folder / "share").c_str(), 1);
  EXPECT_EQ(default_card_path(), test::g1_card());  // nothing there: the next place
  write_file(folder / "share/robots/g1/g1.yaml", test::kSmallCard);
  EXPECT_EQ(default_card_path(), folder / "share/robots/g1/g1.yaml");
  unsetenv("DUET_SHARE");
}

TEST(DefaultCard, NamesThePlacesLookedAt) {
  const test::ScratchFolder folder;
  EXPECT_EQ(thrown_message<MissingError>([&] {
              first_existing("robot card", {folder / "a", folder / "b"});
            }),
            "no robot card: looked at " + folder / "a" + ", " + folder / "b");
}

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
