// The camera on the body from a person at marked places.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/hardware/guard/camera_calibration.h"
#include "duet/hardware/guard/identification.h"
#include "duet/hardware/guard/person_log.h"
#include "duet/hardware/twin/lock_step.h"
#include "duet/robots/dynamics.h"
#include "tests/backends/engine_names.h"
#include "tests/hardware/guarded_twin.h"
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

// A standing robot beside its card: a load and a lean that were put there are found, through noisy sensors.

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kStands = 9.0;    // of the twin's time, off its rope [s]
constexpr double kSeconds = 10.0;  // of standing

std::shared_ptr<const RobotModel> loaded(double kg) {
  auto robot = std::make_shared<RobotModel>(*test::g1());
  robot->links[robot->frames[robot->roles.push_frame].link].mass += kg;
  return robot;
}

// A twin that stands under WBC-Sim behind its guard, `kg` heavier at its trunk, whose IMU leans by `roll`, with the
// noise of sensors and a newton metre on each torque.
StandingFindings findings_of(double kg, double roll, std::uint64_t seed, double seconds = kSeconds) {
  GuardSetup setup = test::twin_guard();
  setup.limiter.robot = loaded(kg);
  TwinInProcess link(setup, noisy_twin(1.0, "mujoco", seed),
                     std::make_unique<Walker>("wbc_sim", ControllerOptions{}, test::g1()), nullptr,
                     {{TwinFaultKind::kTilt, 0.0, 100.0, roll}});
  Random random(seed, 21);
  link.trouble.spoil = [&random](LowStateFrame& frame) {
    for (int j = 0; j < kG1Motors; ++j) frame.motor[j].tau_est += static_cast<float>(random.normal());
  };
  PlannerMessage plan;
  plan.command.q = test::g1()->neutral;
  plan.command.root.height = HardwareLimits{}.height;
  StandingIdentification standing(test::g1());
  GuardReport report;
  while (link.twin().time() < kStands + seconds) {
    ++plan.sequence;
    plan.command.stamp = link.twin().time();
    link.send(plan);
    link.next(report);
    if (link.twin().time() > kStands) standing.see(link.guard().reading());
  }
  EXPECT_EQ(link.twin().physics()->hanging(), 0.0);
  return standing.findings();
}

TEST(Identification, ALoadAndALeanAreFoundWithinATenth) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  constexpr double kLoad = 3.0, kLean = 2.0;
  constexpr int kSeeds = 20;
  double load = 0.0, lean = 0.0, worst_load = 0.0, worst_lean = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const StandingFindings with = findings_of(kLoad, kLean * kDegree, static_cast<std::uint64_t>(seed));
    const double kg = with.mass - with.card_mass, degrees = with.lean.norm() / kDegree;
    load += kg / kSeeds;
    lean += degrees / kSeeds;
    worst_load = std::max(worst_load, std::abs(kg - kLoad));
    worst_lean = std::max(worst_lean, std::abs(degrees - kLean));
  }
  fmt::print(
      "identification: of 3 kg {:.2f} kg (at most {:.2f} off), of 2 degrees {:.2f} (at most {:.2f} off), {} seeds\n",
      load, worst_load, lean, worst_lean, kSeeds);
  EXPECT_LT(worst_load, 0.1 * kLoad);
  EXPECT_LT(worst_lean, 0.1 * kLean);
}

TEST(Identification, ARobotLikeItsCardHasNeither) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const StandingFindings found = findings_of(0.0, 0.0, 7);
  EXPECT_NEAR(found.mass, found.card_mass, 0.3);
  EXPECT_LT(found.lean.norm(), 0.2 * kDegree);
  EXPECT_LT(found.com.norm(), 0.01);
  EXPECT_LT(found.soles_apart, 0.5 * kDegree);
  const std::string text = findings_text(found, *test::g1());
  EXPECT_NE(text.find("not to be told apart"), std::string::npos);
  EXPECT_NEAR(findings_json(found, *test::g1())["mass"].get<double>(), found.mass, 1e-12);
}

TEST(Identification, ALimpRobotIsNoneThatStands) {
  RobotReading reading;
  reading.state = test::g1()->standing_state();
  StandingIdentification standing(test::g1());
  reading.tau.setZero(kG1Motors);
  for (int k = 0; k < 600; ++k) standing.see(reading);
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { (void)standing.findings(); }));
}

TEST(Identification, RefusesWhatDoesNotStand) {
  RobotReading reading;
  reading.state = test::g1()->standing_state();
  StandingIdentification few(test::g1()), moving(test::g1());
  for (int k = 0; k < 100; ++k) few.see(reading);
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { (void)few.findings(); }));
  for (int k = 0; k < 600; ++k) {
    reading.state.q[3] += 0.001;
    moving.see(reading);
  }
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { (void)moving.findings(); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { StandingIdentification none(nullptr); }));
}

}  // namespace
}  // namespace duet
