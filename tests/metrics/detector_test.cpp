#include "duet/metrics/detector.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "duet/metrics/detector.h"
#include "tests/metrics/acting.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::acting;
using test::Scene;
using ::testing::HasSubstr;

constexpr int kSeeds = 40;

void expect_same(const DetectorResult& a, const DetectorResult& b, double tolerance, const std::string& where) {
  EXPECT_EQ(a.success, b.success) << where;
  EXPECT_EQ(a.parts, b.parts) << where;
  ASSERT_EQ(a.margins.size(), b.margins.size()) << where;
  for (const auto& [name, margin] : a.margins) {
    if (std::isfinite(margin)) {
      EXPECT_NEAR(margin, b.margins.at(name), tolerance) << where << " " << name;
    } else {
      EXPECT_EQ(margin, b.margins.at(name)) << where << " " << name;
    }
  }
}

std::string label(Task task, int seed) { return std::string(to_string(task)) + " seed " + std::to_string(seed); }

// Runs `check(task, seed, scene)` over all tasks and seeds.
template <typename Check>
void for_each_scene(Check check) {
  for (const Task task : kPaperTasks)
    for (int seed = 0; seed < kSeeds; ++seed) check(task, seed, acting(task, seed));
}

TEST(Detector, ThresholdsAreThoseOfTableS11) {
  EXPECT_EQ(thresholds(Task::kHug),
            (Thresholds{{"hand_dist", 0.5}, {"body", 0.45}, {"shoulder", 0.4}, {"min_frames", 3}}));
  EXPECT_EQ(thresholds(Task::kHighFive),
            (Thresholds{{"contact", 0.4}, {"min_approach", 1}, {"max_sustained", 1000}, {"height", 0.3}}));
  EXPECT_EQ(thresholds(Task::kHandshake), (Thresholds{{"contact", 0.3},
                                                      {"min_contact", 10},
                                                      {"min_dist", 0.4},
                                                      {"max_dist", 1.5},
                                                      {"std_contact", 0.15},
                                                      {"mean_contact", 0.45}}));
  EXPECT_EQ(thresholds(Task::kWave), (Thresholds{{"motion_dist", 0.5},
                                                 {"min_changes", 3},
                                                 {"amplitude", 0.3},
                                                 {"angle", 0.785},
                                                 {"height", 0.45},
                                                 {"displacement", 0.005}}));
  EXPECT_EQ(thresholds(Task::kBend), (Thresholds{{"min_angle", 0.349}, {"min_frames", 5}}));
  EXPECT_EQ(thresholds(Task::kFlyKiss), (Thresholds{{"hand2head", 0.3}, {"forward_thresh", 0.1}, {"min_forward", 5}}));
}

TEST(Detector, StrictSetChangesWhatItSaysAndNothingElse) {
  EXPECT_EQ(thresholds(Task::kHug, ThresholdSet::kStrict).at("min_frames"), 25);
  EXPECT_EQ(thresholds(Task::kHighFive, ThresholdSet::kStrict).at("contact"), 0.15);
  EXPECT_EQ(thresholds(Task::kHighFive, ThresholdSet::kStrict).at("max_sustained"), 50);
  EXPECT_EQ(thresholds(Task::kBend, ThresholdSet::kStrict).at("min_angle"), std::numbers::pi / 6);
  EXPECT_EQ(thresholds(Task::kFlyKiss, ThresholdSet::kStrict).at("hand2head"), 0.2);
  EXPECT_EQ(thresholds(Task::kHandshake, ThresholdSet::kStrict), thresholds(Task::kHandshake));
  EXPECT_EQ(thresholds(Task::kWave, ThresholdSet::kStrict), thresholds(Task::kWave));
  DetectorReadings given;
  given.hug_single = HugSingle::kOff;
  const DetectorReadings strict = strict_readings(given);
  EXPECT_EQ(strict.bend_direction, BendDirection::kForward);
  EXPECT_EQ(strict.fly_kiss_order, FlyKissOrder::kAfterClosest);
  EXPECT_EQ(strict.hug_single, HugSingle::kOff);
}

TEST(Detector, StrictNeverAcceptsWhatPaperRefuses) {
  for_each_scene([](Task task, int seed, const Scene& s) {
    if (detect(task, s.performer, s.partner, DetectorVersion::kPaper, ThresholdSet::kStrict).success) {
      EXPECT_TRUE(detect(task, s.performer, s.partner, DetectorVersion::kPaper).success) << label(task, seed);
    }
  });
}

TEST(Detector, EveryTaskHasARuleOfTheSetAct) {
  for (const Task task : all_tasks()) {
    EXPECT_FALSE(rule_thresholds(task).empty()) << to_string(task);
    EXPECT_NE(thresholds(task, ThresholdSet::kAct), thresholds(task, ThresholdSet::kStrict)) << to_string(task);
  }
}

TEST(Detector, ARuleRefusesWhatNoDetectorTakes) {
  Scene s = acting(Task::kHug, 1);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] {
    (void)detect_by_rule(Task::kHug, s.performer, s.partner, {{"trunk", 0.4}});
  }));
  s.partner.torso.resize(3, 0);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(
      [&] { (void)detect_by_rule(Task::kHug, s.performer, s.partner, {}); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { (void)parse_threshold_set("acts"); }));
}

TEST(Detector, NamesOfVersionsAndSets) {
  EXPECT_EQ(to_string(DetectorVersion::kPaper), "paper");
  EXPECT_EQ(to_string(DetectorVersion::kRobot), "robot");
  EXPECT_EQ(to_string(ThresholdSet::kPaper), "paper");
  EXPECT_EQ(to_string(ThresholdSet::kStrict), "strict");
  EXPECT_EQ(to_string(ThresholdSet::kAct), "act");
  for (const ThresholdSet set : kThresholdSets) EXPECT_EQ(parse_threshold_set(to_string(set)), set);
}

// The scenes are of use only if both verdicts occur.
TEST(Detector, TestScenesSucceedAndFail) {
  for (const Task task : kPaperTasks) {
    int successes = 0;
    for (int seed = 0; seed < kSeeds; ++seed) {
      const Scene s = acting(task, seed);
      successes += detect_performer(task, s.performer, s.partner, thresholds(task)).success;
    }
    EXPECT_GE(successes, 5) << to_string(task);
    EXPECT_LE(successes, kSeeds - 5) << to_string(task);
  }
}

TEST(Detector, VersionRobotExchangesTheAgents) {
  for_each_scene([](Task task, int seed, const Scene& s) {
    for (const ThresholdSet set : kThresholdSets) {
      const DetectorResult robot = detect(task, s.partner, s.performer, DetectorVersion::kRobot, set);
      const DetectorResult paper = detect(task, s.performer, s.partner, DetectorVersion::kPaper, set);
      expect_same(robot, paper, 0.0, label(task, seed));
      EXPECT_EQ(robot.frames, paper.frames);
      EXPECT_EQ(robot.values, paper.values);
    }
  });
}

// Yaw and translation of the world. A wave's default amplitude is along the axes of the world, so its diameter is
// taken.
TEST(Detector, VerdictsAndMarginsDoNotDependOnTheWorldFrame) {
  const Eigen::AngleAxisd yaw(1.1, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d shift(3.0, -2.0, 0.7);
  const auto move = [&](const Eigen::Vector3d& p) -> Eigen::Vector3d { return yaw * p + shift; };
  DetectorReadings readings;
  readings.wave_amplitude = WaveAmplitude::kDiameter;
  for_each_scene([&](Task task, int seed, const Scene& s) {
    expect_same(detect_performer(task, s.performer, s.partner, thresholds(task), readings),
                detect_performer(task, test::transformed(s.performer, move), test::transformed(s.partner, move),
                                 thresholds(task), readings),
                1e-12, label(task, seed));
  });
}

TEST(Detector, MirrorImageGetsTheSameVerdict) {
  for_each_scene([](Task task, int seed, const Scene& s) {
    expect_same(detect_performer(task, s.performer, s.partner, thresholds(task)),
                detect_performer(task, test::mirrored(s.performer), test::mirrored(s.partner), thresholds(task)), 1e-12,
                label(task, seed));
  });
}

TEST(Detector, ReversalKeepsTheVerdictWhereTimeHasNoDirection) {
  for (const Task task : {Task::kHug, Task::kHandshake, Task::kHighFive, Task::kBend}) {
    for (int seed = 0; seed < kSeeds; ++seed) {
      const Scene s = acting(task, seed);
      const DetectorResult forth = detect_performer(task, s.performer, s.partner, thresholds(task));
      DetectorResult back =
          detect_performer(task, test::reversed(s.performer), test::reversed(s.partner), thresholds(task));
      expect_same(forth, back, 1e-12, label(task, seed));
      std::reverse(back.frames.begin(), back.frames.end());
      EXPECT_EQ(forth.frames, back.frames);
    }
  }
}

TEST(Detector, ScalingLengthsAndThresholdsKeepsTheVerdict) {
  const std::set<std::string> lengths = {"hand_dist", "body",         "shoulder",     "contact",       "min_dist",
                                         "max_dist",  "std_contact",  "mean_contact", "height",        "motion_dist",
                                         "amplitude", "displacement", "hand2head",    "forward_thresh"};
  const auto grow = [](const Eigen::Vector3d& p) -> Eigen::Vector3d { return 2.0 * p; };
  for_each_scene([&](Task task, int seed, const Scene& s) {
    Thresholds scaled = thresholds(task);
    for (auto& [name, value] : scaled)
      if (lengths.contains(name)) value *= 2.0;
    EXPECT_EQ(
        detect_performer(task, s.performer, s.partner, thresholds(task)).parts,
        detect_performer(task, test::transformed(s.performer, grow), test::transformed(s.partner, grow), scaled).parts)
        << label(task, seed);
  });
}

TEST(Detector, TheSmallestMarginHasTheSignOfTheVerdict) {
  for_each_scene([](Task task, int seed, const Scene& s) {
    const DetectorResult result = detect_performer(task, s.performer, s.partner, thresholds(task));
    double decides = std::numeric_limits<double>::infinity();
    for (const auto& [name, margin] : result.margins) decides = std::min(decides, margin);
    if (task == Task::kHug) decides = result.margins.at("overall");
    // A margin in whole frames may be 0 and satisfied; one in metres is never exactly 0 here.
    EXPECT_EQ(result.success, decides >= 0.0) << label(task, seed);
  });
}

// Tightening one threshold by less than its margin keeps a success, by more ends it.
TEST(Detector, MarginsAreHowFarAThresholdMayMove) {
  const std::set<std::string> upper = {"hand_dist", "body",        "shoulder",     "contact",  "max_sustained",
                                       "max_dist",  "std_contact", "mean_contact", "hand2head"};
  int checked = 0;
  for_each_scene([&](Task task, int seed, const Scene& s) {
    const DetectorResult result = detect_performer(task, s.performer, s.partner, thresholds(task));
    if (!result.success || task == Task::kHug) return;
    for (const auto& [name, margin] : result.margins) {
      const double tighter = upper.contains(name) ? -1.0 : 1.0;
      Thresholds tau = thresholds(task);
      tau[name] += tighter * (margin - 1e-9);
      EXPECT_TRUE(detect_performer(task, s.performer, s.partner, tau).success) << label(task, seed) << " " << name;
      tau[name] += tighter * 2e-9;
      EXPECT_FALSE(detect_performer(task, s.performer, s.partner, tau).success) << label(task, seed) << " " << name;
      ++checked;
    }
  });
  EXPECT_GT(checked, 100);
}

TEST(Detector, EvidenceHasOneEntryPerFrame) {
  for_each_scene([](Task task, int seed, const Scene& s) {
    const DetectorResult result = detect_performer(task, s.performer, s.partner, thresholds(task));
    EXPECT_EQ(result.frames.size(), 60U) << label(task, seed);
    if (result.success) {
      EXPECT_TRUE(std::count(result.frames.begin(), result.frames.end(), true) > 0) << label(task, seed);
    }
  });
}

TEST(Detector, GivenThresholdsReplaceThePrintedOnesAndTheRestStay) {
  const Scene s = acting(Task::kBend, 0);
  const DetectorResult printed = detect_performer(Task::kBend, s.performer, s.partner, {});
  const DetectorResult same = detect_performer(Task::kBend, s.performer, s.partner, thresholds(Task::kBend));
  EXPECT_EQ(printed.margins, same.margins);
  const DetectorResult harder = detect_performer(Task::kBend, s.performer, s.partner, {{"min_angle", 3.0}});
  EXPECT_FALSE(harder.success);
  EXPECT_NEAR(harder.margins.at("min_angle"), printed.margins.at("min_angle") - (3.0 - 0.349), 1e-12);
}

TEST(Detector, OneFrameIsJudged) {
  for (const Task task : kPaperTasks) {
    const Agent a = test::standing({0.0, 0.0, 0.9}, 1.0, 1);
    const Agent b = test::standing({1.0, 0.0, 0.9}, -1.0, 1);
    EXPECT_FALSE(detect_performer(task, a, b, {}).success) << to_string(task);
  }
}

TEST(Detector, RefusesAMissingTrackByName) {
  const std::map<Task, std::vector<std::pair<std::string, std::function<Eigen::Matrix3Xd*(Scene&)>>>> needed = {
      {Task::kHug,
       {{"performer.lhand", [](Scene& s) { return &s.performer.lhand; }},
        {"performer.rhand", [](Scene& s) { return &s.performer.rhand; }},
        {"partner.torso", [](Scene& s) { return &s.partner.torso; }},
        {"partner.lshoulder", [](Scene& s) { return &s.partner.lshoulder; }},
        {"partner.rshoulder", [](Scene& s) { return &s.partner.rshoulder; }}}},
      {Task::kHandshake,
       {{"performer.root", [](Scene& s) { return &s.performer.root; }},
        {"partner.lhand", [](Scene& s) { return &s.partner.lhand; }},
        {"partner.rhand", [](Scene& s) { return &s.partner.rhand; }}}},
      {Task::kHighFive,
       {{"performer.root", [](Scene& s) { return &s.performer.root; }},
        {"partner.rhand", [](Scene& s) { return &s.partner.rhand; }}}},
      {Task::kWave, {{"performer.root", [](Scene& s) { return &s.performer.root; }}}},
      {Task::kBend,
       {{"performer.head", [](Scene& s) { return &s.performer.head; }},
        {"performer.root", [](Scene& s) { return &s.performer.root; }}}},
      {Task::kFlyKiss, {{"performer.head", [](Scene& s) { return &s.performer.head; }}, {"partner.root", [](Scene& s) {
                                                                                           return &s.partner.root;
                                                                                         }}}}};
  for (const auto& [task, tracks] : needed) {
    for (const auto& [name, pick] : tracks) {
      const auto message = [&, task = task, &pick = pick](const std::function<void(Eigen::Matrix3Xd&)>& spoil) {
        Scene s = acting(task, 0);
        spoil(*pick(s));
        return test::thrown_message<std::invalid_argument>(
            [&] { (void)detect_performer(task, s.performer, s.partner, {}); });
      };
      EXPECT_THAT(message([](Eigen::Matrix3Xd& m) { m.resize(3, 0); }), HasSubstr(name + " is needed and empty"));
      EXPECT_THAT(message([](Eigen::Matrix3Xd& m) { m = m.leftCols(50).eval(); }), HasSubstr("50"));
      EXPECT_THAT(message([](Eigen::Matrix3Xd& m) { m(1, 7) = std::nan(""); }),
                  HasSubstr(name + " is not finite at frame 7"));
      EXPECT_THAT(message([](Eigen::Matrix3Xd& m) { m(2, 9) = std::numeric_limits<double>::infinity(); }),
                  HasSubstr(name + " is not finite at frame 9"));
    }
  }
}

TEST(Detector, LooksOnlyAtTheTracksOfItsTask) {
  Scene s = acting(Task::kBend, 1);
  Agent bare;
  bare.head = s.performer.head;
  bare.root = s.performer.root;
  EXPECT_EQ(detect_performer(Task::kBend, bare, Agent{}, {}).margins,
            detect_performer(Task::kBend, s.performer, s.partner, {}).margins);
  DetectorReadings torso_only;
  torso_only.hug_shoulder = HugShoulder::kTorsoBoth;
  s = acting(Task::kHug, 1);
  s.partner.lshoulder.resize(3, 0);
  EXPECT_NO_THROW((void)detect_performer(Task::kHug, s.performer, s.partner, {}, torso_only));
}

TEST(Detector, DirectionsNeedTheOtherRootOrTheShoulders) {
  DetectorReadings readings;
  readings.bend_direction = BendDirection::kForward;
  readings.wave_plane = WavePlane::kLateralUp;
  for (const Task task : {Task::kBend, Task::kWave}) {
    Scene s = acting(task, 3);
    s.partner.root.resize(3, 0);
    EXPECT_NO_THROW((void)detect_performer(task, s.performer, s.partner, {}, readings));
    s.performer.rshoulder.resize(3, 0);
    EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(
        [&] { (void)detect_performer(task, s.performer, s.partner, {}, readings); }));
  }
}

TEST(Detector, RefusesUnknownAndInfiniteThresholds) {
  const Scene s = acting(Task::kHug, 0);
  const std::string unknown = test::thrown_message<std::invalid_argument>([&] {
    (void)detect_performer(Task::kHug, s.performer, s.partner, {{"bodi", 0.4}});
  });
  EXPECT_THAT(unknown, HasSubstr("threshold of hug"));
  EXPECT_THAT(unknown, HasSubstr("'body'"));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] {
    (void)detect_performer(Task::kHug, s.performer, s.partner, {{"body", std::nan("")}});
  }));
}

}  // namespace
}  // namespace duet
