// The camera on the body from a person at marked places.
#include "duet/hardware/guard/camera_calibration.h"

#include <fmt/format.h>

#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/hardware/guard/person_log.h"
#include "tests/hardware/limited_robot.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kHeight = 0.74;

// On the head, ahead, 10 degrees down and a little askew.
Pose true_camera() {
  Eigen::Matrix3d R_BC;
  R_BC << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const Eigen::Quaterniond down(Eigen::AngleAxisd(0.17, Eigen::Vector3d::UnitY()));
  return {down * Eigen::Quaterniond(R_BC) * Eigen::Quaterniond(Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitZ())),
          {0.10, 0.02, 0.45}};
}

const std::vector<Eigen::Vector2d> kMarks = {{1.5, 0.0}, {2.5, 0.8}, {2.5, -0.8}, {3.5, 0.0}, {2.0, 0.5}};

MarkedPlace stood_at(const Eigen::Vector2d& mark, Random& random, double noise) {
  MarkedPlace place;
  place.p_BP = {mark.x(), mark.y(), 0.08 - kHeight};
  place.p_CP =
      true_camera().inverse() * place.p_BP + noise * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
  place.estimates = 30;
  return place;
}

std::vector<MarkedPlace> stood(std::span<const Eigen::Vector2d> marks, Random& random, double noise = 0.0) {
  std::vector<MarkedPlace> places;
  for (const Eigen::Vector2d& mark : marks) places.push_back(stood_at(mark, random, noise));
  return places;
}

TEST(CameraCalibration, WithoutNoiseIsTheCamera) {
  Random random(1, 1);
  for (const std::size_t n : {3, 4, 5}) {
    const CameraCalibration found = calibrate_camera(stood(std::span(kMarks).first(n), random), "x");
    EXPECT_LE((found.X_BC.p - true_camera().p).norm(), 1e-12);
    EXPECT_LE(found.X_BC.R.angularDistance(true_camera().R), 1e-7);
    EXPECT_LE(found.rms, 1e-12);
    EXPECT_NEAR(found.scale, 1.0, 1e-12);
  }
}

// The errors that it states are those that it makes: their squares by the stated variances average to 1.
TEST(CameraCalibration, StatesTheErrorThatItMakes) {
  constexpr int kTrials = 400;
  Random random(7, 3);
  Eigen::Matrix<double, 6, 1> made = Eigen::Matrix<double, 6, 1>::Zero(), stated = made;
  for (int trial = 0; trial < kTrials; ++trial) {
    const CameraCalibration found = calibrate_camera(stood(kMarks, random, 0.02), "x");
    const Eigen::AngleAxisd turned(found.X_BC.R * true_camera().R.inverse());
    Eigen::Matrix<double, 6, 1> error;
    error << found.X_BC.p - true_camera().p, turned.angle() * turned.axis();
    made += error.cwiseAbs2() / kTrials;
    stated.head<3>() += found.position_error.cwiseAbs2() / kTrials;
    stated.tail<3>() += found.rotation_error.cwiseAbs2() / kTrials;
  }
  // Both are means of 400 squares of normal numbers, the stated ones of 9 each: within a quarter.
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(made[k] / stated[k], 1.0, 0.25) << k;
}

TEST(CameraCalibration, AnotherFocalLengthShowsInTheScale) {
  Random random(1, 1);
  std::vector<MarkedPlace> places = stood(kMarks, random);
  for (MarkedPlace& place : places) place.p_CP *= 24.4;
  const CameraCalibration found = calibrate_camera(places, "x");
  EXPECT_NEAR(found.scale, 1.0 / 24.4, 1e-12);
  EXPECT_GT(found.rms, 0.1);
}

TEST(CameraCalibration, RefusesFewPlacesAndThoseOnOneLine) {
  Random random(1, 1);
  const auto refusal = [&](const std::vector<Eigen::Vector2d>& marks) {
    return test::thrown_message<InputError>([&] { (void)calibrate_camera(stood(marks, random), "places.yaml"); });
  };
  EXPECT_SENTENCE(refusal({{1.5, 0.0}, {2.5, 0.8}}));
  EXPECT_SENTENCE(refusal({{1.5, 0.0}, {2.5, 0.1}, {3.5, 0.2}, {4.5, 0.3}}));
}

// Somebody walks from mark to mark and stands at each for two seconds.
struct Walked {
  Walked() {
    std::vector<RecordedEstimate> log;
    for (std::uint64_t k = 0; k < 30 * 3 * kMarks.size(); ++k) {
      const std::size_t from = k / 90;
      const double part = std::max(static_cast<double>(k % 90) - 60.0, 0.0) / 30.0;
      const Eigen::Vector2d at = kMarks[from] + part * (kMarks[std::min(from + 1, kMarks.size() - 1)] - kMarks[from]);
      PersonEstimate estimate;
      estimate.sequence = k + 1;
      estimate.stamp = 100.0 + static_cast<double>(k) / 30.0;
      estimate.seen = true;
      HumanJoints joints = test::standing_adult({at.x(), at.y(), 0.0});
      const Eigen::Vector3d ankles = 0.5 * (joints.col(7) + joints.col(8));
      joints.colwise() += Eigen::Vector3d(at.x(), at.y(), 0.08 - kHeight) - ankles;
      for (int j = 0; j < kSmplJoints; ++j)
        estimate.joints.col(j) = true_camera().inverse() * Eigen::Vector3d(joints.col(j));
      log.push_back(recorded(estimate));
    }
    write_file(folder / "person.dpj", person_log(log));
    for (std::size_t k = 0; k < kMarks.size(); ++k)
      text += fmt::format("  - {{at: [{}, {}], seconds: [{}, {}]}}\n", kMarks[k].x(), kMarks[k].y(), 3 * k, 3 * k + 2);
  }
  std::string refusal(const std::string& changed) const {
    write_file(folder / "places.yaml", changed);
    return test::thrown_message<InputError>([&] { (void)read_marked_places(folder / "places.yaml"); });
  }
  test::ScratchFolder folder;
  std::string head = "schema: duet.calibration/1\nlog: person.dpj\nheight: 0.74\n";
  std::string text = head + "places:\n";
};

TEST(CameraCalibration, IsReadFromPlacesAndALog) {
  const Walked walked;
  write_file(walked.folder / "places.yaml", walked.text);
  const std::vector<MarkedPlace> places = read_marked_places(walked.folder / "places.yaml");
  ASSERT_EQ(places.size(), kMarks.size());
  EXPECT_EQ(places[0].estimates, 61);
  const CameraCalibration found = calibrate_camera(places, "x");
  EXPECT_LE((found.X_BC.p - true_camera().p).norm(), 2e-3);  // the last of 61 estimates has begun to walk
  EXPECT_LE(found.X_BC.R.angularDistance(true_camera().R), 2e-3);
}

TEST(CameraCalibration, NamesWhatIsWrongInItsFile) {
  const Walked walked;
  EXPECT_SENTENCE(walked.refusal("schema: duet.robot/1\n"));
  EXPECT_SENTENCE(walked.refusal("schema: duet.calibration/1\nlog: nowhere.dpj\nheight: 0.74\nplaces: []\n"));
  EXPECT_SENTENCE(walked.refusal("schema: duet.calibration/1\nlog: person.dpj\nheight: 7\nplaces: []\n"));
  EXPECT_SENTENCE(walked.refusal(walked.head + "places:\n  - {at: [1.5], seconds: [0, 2]}\n"));
  EXPECT_SENTENCE(walked.refusal(walked.head + "places:\n  - {at: [1.5, 0], seconds: [90, 92]}\n"));
  EXPECT_SENTENCE(walked.refusal(walked.head + "places:\n  - {at: [1.5, 0], seconds: [0, 6]}\n"));
}

}  // namespace
}  // namespace duet
