
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/people/body_people.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

// A synthetic clip as a file with y up would hold it, person B brought into a world of her own by `apart`.
RawPeople recorded_apart(Task task, const Pose& apart, double metres_per_unit = 1.0) {
  const InteractionClip clip = synthesize(task, {});
  RawPeople raw{.id = clip.id, .name = "a.npz", .joints = {clip.a.joints, clip.b.joints}};
  raw.layout = &joint_layout("smpl-24");
  raw.rate_hz = clip.rate_hz();
  raw.up = Axis::kPlusY;
  raw.metres_per_unit = metres_per_unit;
  Eigen::Matrix3d R_FW;  // x, z, -y
  R_FW << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  for (const std::size_t who : {0, 1}) {
    raw.rotations[who].assign(static_cast<std::size_t>(clip.frames()) * kSmplJoints, Eigen::Quaterniond(R_FW));
    for (int t = 0; t < clip.frames(); ++t)
      for (int j = 0; j < kSmplJoints; ++j) {
        Eigen::Vector3d p = raw.joints[who].at(t, j);
        if (who == 1) p = apart * p;
        raw.joints[who].at(t, j) = R_FW * p / metres_per_unit;
      }
  }
  return raw;
}

constexpr double kFar = 40.0;
const Pose kElsewhere{.R = yaw_rotation(2.1), .p = {kFar, -7.0, 0.35}};

double least_gap(const RawPeople& raw, int joint_a, int joint_b) {
  double least = 1e9;
  for (int t = 0; t < raw.joints[0].frames(); ++t)
    least = std::min(least, (raw.joints[0].at(t, joint_a) - raw.joints[1].at(t, joint_b)).norm());
  return least;
}

double toe_height(const RawPeople& raw, std::size_t who) {
  double least = 1e9;
  for (int t = 0; t < raw.joints[who].frames(); ++t)
    least = std::min({least, raw.joints[who].at(t, kLeftToe).y(), raw.joints[who].at(t, kRightToe).y()});
  return least;
}

PeopleOptions with(Alignment align) {
  PeopleOptions options;
  options.align = align;
  return options;
}

TEST(Alignment, ContactBringsTheHandsOfAHandshakeTogether) {
  for (const Task task : {Task::kHandshake, Task::kHighFive}) {
    RawPeople raw = recorded_apart(task, kElsewhere);
    ASSERT_GT(least_gap(raw, kRightHand, kRightHand), 10.0);
    align_people(raw, with(Alignment::kContact));
    const double gap = std::min({least_gap(raw, kRightHand, kRightHand), least_gap(raw, kLeftHand, kLeftHand),
                                 least_gap(raw, kRightHand, kLeftHand), least_gap(raw, kLeftHand, kRightHand)});
    EXPECT_LT(gap, 0.12) << to_string(task);
    EXPECT_NEAR(toe_height(raw, 0), toe_height(raw, 1), 0.03);
    EXPECT_EQ(raw.source.at("provenance"), "estimated shared frame");
    EXPECT_EQ(raw.source.at("alignment"), "contact");
    EXPECT_SENTENCE(raw.evidence);
  }
}

TEST(Alignment, PeopleAlignedByContactFaceEachOtherAsTheyDid) {
  const RawPeople original = recorded_apart(Task::kHandshake, {});
  RawPeople raw = recorded_apart(Task::kHandshake, kElsewhere);
  align_people(raw, with(Alignment::kContact));
  const double before = least_gap(original, kPelvis, kPelvis), after = least_gap(raw, kPelvis, kPelvis);
  EXPECT_NEAR(before, after, 0.25);
}

TEST(Alignment, FloorKeepsPlausiblePlacesAndLevelsTheFloors) {
  const Pose lifted{.R = Eigen::Quaterniond::Identity(), .p = {0.0, 0.0, 0.4}};
  const RawPeople original = recorded_apart(Task::kHandshake, {});
  RawPeople raw = recorded_apart(Task::kHandshake, lifted);
  align_people(raw, with(Alignment::kFloor));
  EXPECT_LT((raw.joints[1].at(0, kHead) - original.joints[1].at(0, kHead)).norm(), 0.02);
  EXPECT_EQ(raw.joints[0], original.joints[0]);  // A stays
  EXPECT_SENTENCE(raw.evidence);
}

TEST(Alignment, FloorPutsPeopleWhoAreFarApartFaceToFace) {
  RawPeople raw = recorded_apart(Task::kWave, kElsewhere);
  const RawPeople before = raw;
  align_people(raw, with(Alignment::kFloor));
  const int middle = raw.joints[0].frames() / 2;
  EXPECT_NEAR((raw.joints[0].at(middle, kPelvis) - raw.joints[1].at(middle, kPelvis))
                  .cwiseProduct(Eigen::Vector3d(1, 0, 1))
                  .norm(),
              0.8, 1e-6);
  EXPECT_SENTENCE(raw.evidence);
  // A rigid motion: the same turn for joints and rotations, in every frame.
  const Eigen::Quaterniond turn = raw.rotations[1][0] * before.rotations[1][0].conjugate();
  for (const int t : {0, middle, raw.joints[0].frames() - 1})
    for (const int j : {kHead, kLeftHand, kRightToe}) {
      const Eigen::Vector3d was = before.joints[1].at(t, j) - before.joints[1].at(0, kPelvis);
      const Eigen::Vector3d is = raw.joints[1].at(t, j) - raw.joints[1].at(0, kPelvis);
      EXPECT_LT((is - turn * was).norm(), 1e-9);
    }
  EXPECT_LT((turn * Eigen::Vector3d::UnitY() - Eigen::Vector3d::UnitY()).norm(), 1e-12);  // about the vertical
}

TEST(Alignment, UnitsAndAnUnknownUpAxisAreFoundInTheData) {
  RawPeople raw = recorded_apart(Task::kHandshake, kElsewhere, 0.01);
  raw.up.reset();
  align_people(raw, with(Alignment::kContact));
  EXPECT_LT(least_gap(raw, kRightHand, kRightHand), 12.0);  // [cm]
  EXPECT_SENTENCE(raw.evidence);
}

TEST(Alignment, HandsThatCannotMeetAreRefused) {
  RawPeople raw = recorded_apart(Task::kHandshake, kElsewhere);
  // Somebody whose hands are always on the floor.
  for (int t = 0; t < raw.joints[1].frames(); ++t)
    for (const int hand : {kLeftHand, kRightHand}) raw.joints[1].at(t, hand).y() -= 3.0;
  EXPECT_SENTENCE(thrown_message<InputError>([&] { align_people(raw, with(Alignment::kContact)); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { align_people(raw, {}); }));
}

}  // namespace
}  // namespace duet
