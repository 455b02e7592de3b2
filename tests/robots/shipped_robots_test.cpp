// The G1 that ships with duet against the maker's description, the supplement and recorded motions.
#include <algorithm>
#include <map>

#include "duet/archives/pickle/pickle_fields.h"
#include "duet/core/recording.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/robot_cards.h"
#include "duet/robots/roles.h"
#include "duet/robots/urdf.h"
#include "tests/robots/fixtures.h"

namespace duet {
namespace {

using test::g1;

const char* const kMotorOrder[] = {
    "left_hip_pitch",     "left_hip_roll",     "left_hip_yaw",         "left_knee",
    "left_ankle_pitch",   "left_ankle_roll",   "right_hip_pitch",      "right_hip_roll",
    "right_hip_yaw",      "right_knee",        "right_ankle_pitch",    "right_ankle_roll",
    "waist_yaw",          "waist_roll",        "waist_pitch",          "left_shoulder_pitch",
    "left_shoulder_roll", "left_shoulder_yaw", "left_elbow",           "left_wrist_roll",
    "left_wrist_pitch",   "left_wrist_yaw",    "right_shoulder_pitch", "right_shoulder_roll",
    "right_shoulder_yaw", "right_elbow",       "right_wrist_roll",     "right_wrist_pitch",
    "right_wrist_yaw"};

TEST(G1, JointsStandInUnitreesMotorOrder) {
  ASSERT_EQ(g1().dof(), 29);
  for (int j = 0; j < 29; ++j) EXPECT_EQ(g1().joints[j].name, std::string(kMotorOrder[j]) + "_joint");
  for (size_t i = 1; i < g1().links.size(); ++i) EXPECT_LT(g1().links[i].parent, static_cast<int>(i));
}

TEST(G1, MassAndDegreesOfFreedom) {
  EXPECT_NEAR(g1().total_mass(), 33.341142, 1e-6);
  EXPECT_EQ(g1().links.size(), 30u);
}

TEST(G1, AgreesWithTheMakersDescription) {
  const std::string path = test::shared_file("g1/g1_29dof_rev_1_0.urdf");
  if (path.empty()) GTEST_SKIP() << "not run: g1/g1_29dof_rev_1_0.urdf absent";
  const RobotModel maker = load_robot(test::g1_card(), path);
  constexpr double kEqual = 1e-9;
  for (int i = 0; i < 30; ++i) {
    const RobotLink &a = g1().links[i], &b = maker.links[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.parent, b.parent);
    EXPECT_NEAR(a.mass, b.mass, kEqual);
    EXPECT_LT((a.com - b.com).norm(), kEqual);
    EXPECT_LT((a.inertia - b.inertia).norm(), kEqual);
    EXPECT_LT((a.X_PL.p - b.X_PL.p).norm(), kEqual);
    EXPECT_LT((a.X_PL.R.toRotationMatrix() - b.X_PL.R.toRotationMatrix()).norm(), kEqual);
    if (i == 0) continue;
    EXPECT_LT((a.axis - b.axis).norm(), kEqual);
    EXPECT_NEAR(g1().joints[i - 1].lower, maker.joints[i - 1].lower, kEqual);
    EXPECT_NEAR(g1().joints[i - 1].upper, maker.joints[i - 1].upper, kEqual);
    EXPECT_EQ(g1().joints[i - 1].effort, maker.joints[i - 1].effort);
    EXPECT_EQ(g1().joints[i - 1].velocity, maker.joints[i - 1].velocity);
  }
  ASSERT_EQ(g1().frames.size(), maker.frames.size());
  for (size_t f = 0; f < maker.frames.size(); ++f) {
    const RobotFrame& frame = g1().frames[g1().frame_index(maker.frames[f].name)];
    EXPECT_EQ(frame.link, maker.frames[f].link) << frame.name;
    EXPECT_LT((frame.X_LF.p - maker.frames[f].X_LF.p).norm(), kEqual) << frame.name;
  }
}

TEST(G1, PairsAreThoseOfTheSupplement) {
  const std::pair<const char*, const char*> pairs[] = {{"pelvis", "pelvis"},
                                                       {"left_hip_pitch_link", "left_hip"},
                                                       {"left_knee_link", "left_knee"},
                                                       {"left_ankle_roll_link", "left_ankle"},
                                                       {"right_hip_pitch_link", "right_hip"},
                                                       {"right_knee_link", "right_knee"},
                                                       {"right_ankle_roll_link", "right_ankle"},
                                                       {"left_shoulder_roll_link", "left_shoulder"},
                                                       {"left_elbow_link", "left_elbow"},
                                                       {"left_hand_link", "left_hand"},
                                                       {"right_shoulder_roll_link", "right_shoulder"},
                                                       {"right_elbow_link", "right_elbow"},
                                                       {"right_hand_link", "right_hand"},
                                                       {"head_link", "head"},
                                                       {"left_toe_link", "left_toe"},
                                                       {"right_toe_link", "right_toe"}};
  ASSERT_EQ(g1().pairs.size(), 16u);
  for (int k = 0; k < 16; ++k) {
    EXPECT_EQ(g1().frames[g1().pairs[k].frame].name, pairs[k].first);
    EXPECT_EQ(kSmplNames[g1().pairs[k].smpl], pairs[k].second);
  }
}

TEST(G1, KeypointsGoLeftBeforeRight) {
  const std::vector<std::string> expected = {"head",        "left_shoulder", "right_shoulder",
                                             "left_elbow",  "right_elbow",   "left_wrist",
                                             "right_wrist", "left_hand",     "right_hand"};
  ASSERT_EQ(g1().keypoints.size(), expected.size());
  for (size_t k = 0; k < expected.size(); ++k) {
    EXPECT_EQ(g1().keypoints[k].name, expected[k]);
    EXPECT_EQ(kSmplNames[g1().keypoints[k].smpl], expected[k]);
  }
}

TEST(G1, TracksNameTheDetectorsFrames) {
  const std::map<std::string, std::string> expected = {{"head", "head_link"},
                                                       {"lhand", "left_hand_link"},
                                                       {"rhand", "right_hand_link"},
                                                       {"torso", "chest_link"},
                                                       {"lshoulder", "left_shoulder_roll_link"},
                                                       {"rshoulder", "right_shoulder_roll_link"}};
  ASSERT_EQ(g1().tracks.size(), expected.size());
  for (const auto& [track, frame] : expected) EXPECT_EQ(g1().frames[g1().tracks.at(track)].name, frame);
}

TEST(G1, VirtualFramesStandWhereTheCardSays) {
  const auto check = [](const char* name, const char* link, const Eigen::Vector3d& p) {
    const RobotFrame& frame = g1().frames[g1().frame_index(name)];
    EXPECT_EQ(g1().links[frame.link].name, link);
    EXPECT_LT((frame.X_LF.p - p).norm(), 1e-15) << name;
  };
  check("head_link", "torso_link", {0.01, 0, 0.42});
  check("left_hand_link", "left_wrist_yaw_link", {0.09, 0.003, 0});
  check("right_hand_link", "right_wrist_yaw_link", {0.09, -0.003, 0});
  check("left_toe_link", "left_ankle_roll_link", {0.12, 0, -0.03});
  check("right_toe_link", "right_ankle_roll_link", {0.12, 0, -0.03});
}

TEST(G1, NeutralPoseIsTheSupplements) {
  const auto at = [](const char* name) { return g1().neutral[g1().joint_index(name)]; };
  for (const char* side : {"left", "right"}) {
    const double sign = side[0] == 'l' ? 1.0 : -1.0;
    const std::string s = side;
    EXPECT_EQ(at((s + "_shoulder_pitch_joint").c_str()), 0.0);
    EXPECT_EQ(at((s + "_shoulder_roll_joint").c_str()), 0.3 * sign);
    EXPECT_EQ(at((s + "_shoulder_yaw_joint").c_str()), 0.0);
    EXPECT_EQ(at((s + "_elbow_joint").c_str()), 1.0);
    EXPECT_EQ(at((s + "_hip_pitch_joint").c_str()), -0.312);
    EXPECT_EQ(at((s + "_knee_joint").c_str()), 0.669);
    EXPECT_EQ(at((s + "_ankle_pitch_joint").c_str()), -0.363);
  }
}

TEST(G1, StandsOnItsSoles) {
  const RobotState state = g1().standing_state();
  Kinematics kinematics(g1());
  kinematics.update(state.X_WB, state.q);
  ASSERT_EQ(g1().feet.size(), 8u);
  double lowest = 1.0, highest = -1.0;
  for (size_t k = 0; k < 8; ++k) {
    const RobotShape& shape = g1().shapes[g1().feet[k]];
    EXPECT_EQ(g1().links[shape.link].name, k < 4 ? "left_ankle_roll_link" : "right_ankle_roll_link");
    EXPECT_EQ(shape.radius, 0.005);
    const double bottom = kinematics.shape_position(g1().feet[k]).z() - shape.radius;
    lowest = std::min(lowest, bottom);
    highest = std::max(highest, bottom);
  }
  EXPECT_NEAR(lowest, 0.0, 1e-15);
  EXPECT_LT(highest, 0.0011);  // the leg angles sum to -0.006 rad over a sole of 0.17 m
  EXPECT_NEAR(g1().standing_height, 0.756997, 1e-6);
}

TEST(G1, CenterOfMassIsOverTheSoles) {
  const RobotState state = g1().standing_state();
  Kinematics kinematics(g1());
  kinematics.update(state.X_WB, state.q);
  const Eigen::Vector3d com = kinematics.center_of_mass();
  EXPECT_GT(com.x(), -0.04);
  EXPECT_LT(com.x(), 0.11);
  EXPECT_NEAR(com.y(), 0.0, 1e-3);
}

TEST(G1, ShapesAreSymmetricAndAboveTheSoles) {
  const RobotState state = g1().standing_state();
  Kinematics kinematics(g1());
  kinematics.update(state.X_WB, state.q);
  std::map<std::string, std::vector<Eigen::Vector3d>> sides[2];
  for (size_t s = 0; s < g1().shapes.size(); ++s) {
    const RobotShape& shape = g1().shapes[s];
    const Eigen::Vector3d p = kinematics.shape_position(static_cast<int>(s));
    EXPECT_GE(p.z() - shape.radius - shape.half_length, -1e-12);
    EXPECT_FALSE(shape.region.empty());
    const std::string& link = g1().links[shape.link].name;
    if (link.starts_with("left_")) sides[0][link.substr(5)].push_back(p);
    if (link.starts_with("right_")) sides[1][link.substr(6)].push_back({p.x(), -p.y(), p.z()});
  }
  ASSERT_EQ(sides[0].size(), sides[1].size());
  for (const auto& [link, left] : sides[0]) {
    const std::vector<Eigen::Vector3d>& right = sides[1].at(link);
    ASSERT_EQ(left.size(), right.size());
    if (link == "ankle_roll_link") continue;  // inner and outer spheres change places
    for (size_t k = 0; k < left.size(); ++k) EXPECT_LT((left[k] - right[k]).norm(), 1e-3) << link;
  }
}

struct SegmentInWorld {
  Eigen::Vector3d from, along;
  double radius;
};

SegmentInWorld segment_of(const Kinematics& kinematics, int shape) {
  const RobotShape& s = g1().shapes[shape];
  const Eigen::Vector3d half = kinematics.R_WL(s.link) * (s.X_LS.R * Eigen::Vector3d(0, 0, s.half_length));
  return {kinematics.shape_position(shape) - half, 2.0 * half, s.radius};
}

// By sampling both axes: an upper bound of the clearance to a few millimetres.
double sampled_clearance(const Kinematics& kinematics, int first, int second) {
  const SegmentInWorld a = segment_of(kinematics, first), b = segment_of(kinematics, second);
  constexpr int kSamples = 40;
  double nearest = 10.0;
  for (int i = 0; i <= kSamples; ++i)
    for (int k = 0; k <= kSamples; ++k)
      nearest = std::min(
          nearest, (a.from + a.along * i / kSamples - b.from - b.along * k / kSamples).norm() - a.radius - b.radius);
  return nearest;
}

TEST(G1, NoDeclaredPairIsNearInTheNeutralPose) {
  Kinematics kinematics(g1());
  kinematics.update({}, g1().neutral);
  double smallest = 10.0;
  for (const auto& [first, second] : g1().self_collision)
    smallest = std::min(smallest, sampled_clearance(kinematics, first, second));
  EXPECT_NEAR(smallest, 0.084, 0.002);  // elbow and chest
}

TEST(G1, DeclaredPairsAreThoseOfHandsForearmsThighsTrunkAndHead) {
  std::map<std::pair<std::string, std::string>, int> found;
  for (const auto& [first, second] : g1().self_collision) {
    const RobotShape &a = g1().shapes[first], &b = g1().shapes[second];
    EXPECT_LT(first, second);
    ++found[std::minmax(a.region, b.region)];
    if (a.region != "thigh") continue;
    const std::string &link = g1().links[a.link].name, &other = g1().links[b.link].name;
    if (b.region == "thigh") {
      EXPECT_NE(link[0], other[0]) << link << " " << other;  // of two legs
    }
  }
  const std::map<std::pair<std::string, std::string>, int> expected = {
      {{"hand", "hand"}, 1},      {{"forearm", "hand"}, 4},  {{"hand", "thigh"}, 8},      {{"hand", "pelvis"}, 2},
      {{"hand", "torso"}, 4},     {{"hand", "head"}, 2},     {{"forearm", "forearm"}, 4}, {{"forearm", "thigh"}, 16},
      {{"forearm", "pelvis"}, 4}, {{"forearm", "torso"}, 8}, {{"forearm", "head"}, 4},    {{"thigh", "thigh"}, 4}};
  EXPECT_EQ(found, expected);
  EXPECT_EQ(g1().self_collision.size(), 61U);
}

TEST(G1, ArmatureIsPositiveEverywhere) {
  for (const RobotJoint& joint : g1().joints) EXPECT_GT(joint.armature, 0.003) << joint.name;
  EXPECT_EQ(g1().joints[g1().joint_index("left_ankle_pitch_joint")].armature,
            2.0 * g1().joints[g1().joint_index("left_elbow_joint")].armature);
}

// Motions recorded with another program's kinematics: positions of bodies relative to the pelvis, in its axes.
TEST(G1, ReproducesTheBodyPositionsOfRecordedMotions) {
  for (const char* name : {"walk_001", "walk_003", "walk_008"}) {
    const std::string path = test::shared_file(fmt::format("data/g1_motions/twist2/{}.pkl", name));
    if (path.empty()) GTEST_SKIP() << "not run: data/g1_motions/twist2 absent";
    const PickledMotion recorded = read_motion_pickle(path);
    Kinematics kinematics(g1());
    int compared = 0;
    double worst = 0.0;
    for (int t = 0; t < recorded.motion.frames(); t += 7) {
      kinematics.update({}, recorded.motion.q.col(t));
      for (size_t b = 0; b < recorded.link_body_list.size(); ++b) {
        const std::string& body = recorded.link_body_list[b];
        const bool ours =
            std::any_of(g1().links.begin(), g1().links.end(), [&](const RobotLink& link) { return link.name == body; });
        if (!ours) continue;  // head, toe and hand bodies of that model are not the card's
        const Eigen::Vector3d p = kinematics.frame_position(g1().frame_index(body));
        worst = std::max(worst, (p - recorded.local_body_pos.at(t, static_cast<int>(b))).norm());
        ++compared;
      }
    }
    EXPECT_GT(compared, 500);
    EXPECT_LT(worst, 1e-4) << name;
  }
}

// The Booster T1 that ships with duet against the maker's description; its roles where they are others than the G1's.

const RobotModel& t1() {
  static const RobotModel model = load_robot(card_path("t1"));
  return model;
}

Eigen::VectorXd with_waist(double angle) {
  Eigen::VectorXd q = t1().neutral;
  q[t1().joint_index("Waist")] = angle;
  return q;
}

TEST(T1, MassDegreesOfFreedomAndHeight) {
  EXPECT_EQ(t1().dof(), 29);
  EXPECT_NEAR(t1().total_mass(), 33.52, 5e-3);
  EXPECT_NEAR(t1().standing_height, 0.679, 5e-4);
  EXPECT_EQ(t1().feet.size(), 8u);
}

TEST(T1, AgreesWithTheMakersDescription) {
  const std::string path = test::shared_file("t1/t1_29dof.urdf");
  if (path.empty()) GTEST_SKIP() << "not run: t1/t1_29dof.urdf absent";
  const RobotModel maker = load_robot(card_path("t1"), path);
  constexpr double kEqual = 1e-9;
  ASSERT_EQ(t1().links.size(), maker.links.size());
  for (std::size_t i = 0; i < maker.links.size(); ++i) {
    const RobotLink &a = t1().links[i], &b = maker.links[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.parent, b.parent);
    EXPECT_NEAR(a.mass, b.mass, kEqual);
    EXPECT_LT((a.com - b.com).norm(), kEqual);
    EXPECT_LT((a.inertia - b.inertia).norm(), kEqual);
    EXPECT_LT((a.X_PL.p - b.X_PL.p).norm(), kEqual);
    EXPECT_LT((a.X_PL.R.toRotationMatrix() - b.X_PL.R.toRotationMatrix()).norm(), kEqual);
    if (i == 0) continue;
    EXPECT_LT((a.axis - b.axis).norm(), kEqual);
    EXPECT_EQ(t1().joints[i - 1].lower, maker.joints[i - 1].lower);
    EXPECT_EQ(t1().joints[i - 1].upper, maker.joints[i - 1].upper);
    EXPECT_EQ(t1().joints[i - 1].effort, maker.joints[i - 1].effort);
    EXPECT_EQ(t1().joints[i - 1].velocity, maker.joints[i - 1].velocity);
  }
  ASSERT_EQ(t1().frames.size(), maker.frames.size());
  for (const RobotFrame& frame : maker.frames) {
    const RobotFrame& ours = t1().frames[t1().frame_index(frame.name)];
    EXPECT_EQ(ours.link, frame.link) << frame.name;
    EXPECT_LT((ours.X_LF.p - frame.X_LF.p).norm(), kEqual) << frame.name;
  }
}

TEST(T1, ThePelvisHangsBelowTheBaseAndTurnsWithTheWaist) {
  EXPECT_FALSE(base_is_pelvis(t1()));
  const Pose still = pelvis_in_base(t1(), with_waist(0.0)), turned = pelvis_in_base(t1(), with_waist(0.7));
  EXPECT_LT((still.p - Eigen::Vector3d(0.0625, 0.0, -0.1155)).norm(), 1e-15);
  EXPECT_LT((turned.p - still.p).norm(), 1e-15);
  EXPECT_NEAR(yaw_of(turned.R), 0.7, 1e-15);
  Kinematics kinematics(t1());
  kinematics.update({}, with_waist(0.7));
  EXPECT_LT((kinematics.frame_position(t1().frame_index("Waist")) - turned.p).norm(), 1e-15);
}

TEST(T1, ItsWaistTiltsNothingAndItsLegsBeginBelowIt) {
  EXPECT_TRUE(tilting_waist(t1()).empty());
  EXPECT_EQ(leg_joints(t1()).size(), 12u);
  EXPECT_EQ(t1().joints[t1().roles.legs[0].front()].name, "Left_Hip_Pitch");
}

TEST(T1, MirroringTheNeutralPoseGivesTheNeutralPose) {
  for (int j = 0; j < t1().dof(); ++j)
    EXPECT_EQ(mirror_sign(t1(), j) * t1().neutral[j], t1().neutral[t1().roles.counterpart[j]]) << t1().joints[j].name;
}

// Its waist yaw has no counterpart: mirrored, it turns the other way.
TEST(T1, MirroredAnglesMirrorEveryPair) {
  Eigen::VectorXd q = t1().neutral, mirrored = q;
  Random random(1, 1);
  for (int j = 0; j < t1().dof(); ++j) q[j] += random.uniform(-0.2, 0.2);
  for (int j = 0; j < t1().dof(); ++j) mirrored[t1().roles.counterpart[j]] = mirror_sign(t1(), j) * q[j];
  Kinematics kinematics(t1()), image(t1());
  kinematics.update({}, q);
  image.update({}, mirrored);
  const auto place = [](const Kinematics& k, const char* frame) { return k.frame_position(t1().frame_index(frame)); };
  for (const auto& [left, right] : std::initializer_list<std::pair<const char*, const char*>>{
           {"left_palm_link", "right_palm_link"}, {"left_toe_link", "right_toe_link"}, {"head_link", "head_link"}}) {
    const Eigen::Vector3d a = place(kinematics, left), b = place(image, right);
    EXPECT_LT((a - Eigen::Vector3d(b.x(), -b.y(), b.z())).norm(), 2e-3)
        << left;  // the maker's shoulders are 0.9 mrad off
  }
}

}  // namespace
}  // namespace duet
