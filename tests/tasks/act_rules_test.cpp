// The rules of the set act, one by one: what each asks for, on both sides of its threshold, on tracks made by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "duet/metrics/detector.h"
#include "tests/metrics/acting.h"

namespace duet {
namespace {

using Scene = test::Scene;

constexpr double kShoulders = 0.45;  // over the root (tests/metrics/acting.h)

// Two who stand still and face one another, hands hanging; the partner's trunk is at (trunks, 0, 1.25).
Scene facing(double trunks, int frames) {
  return {test::standing({0.0, 0.0, 0.9}, 1.0, frames), test::standing({trunks, 0.0, 0.9}, -1.0, frames)};
}

bool accepts(Task task, const Scene& s) {
  return detect(task, s.performer, s.partner, DetectorVersion::kPaper, ThresholdSet::kAct).success;
}

Scene turned(const Scene& s) {
  const Eigen::AngleAxisd yaw(2.1, Eigen::Vector3d::UnitZ());
  const auto move = [&](const Eigen::Vector3d& p) -> Eigen::Vector3d { return yaw * p + Eigen::Vector3d(3, -2, 0.4); };
  return {test::transformed(s.performer, move), test::transformed(s.partner, move)};
}
Scene mirrored(const Scene& s) { return {test::mirrored(s.performer), test::mirrored(s.partner)}; }

// As a camera of `rate_hz` would have seen it, brought back to 50 Hz.
Scene seen_at(Scene s, double rate_hz) {
  for (Agent* agent : {&s.performer, &s.partner})
    for (Eigen::Matrix3Xd* track : test::tracks_of(*agent)) {
      const Eigen::Matrix3Xd full = *track;
      const auto last = static_cast<int>((full.cols() - 1) * rate_hz / 50.0);
      const auto sample = [&](int i) -> Eigen::Vector3d {
        return full.col(std::lround(std::min(i, last) * 50.0 / rate_hz));
      };
      for (Eigen::Index t = 0; t < full.cols(); ++t) {
        const double at = t * rate_hz / 50.0;
        const int i = static_cast<int>(at);
        track->col(t) = sample(i) + (at - i) * (sample(i + 1) - sample(i));
      }
    }
  return s;
}

// ---- hug

// A hand of the performer `before` the partner's trunk and `aside` of it.
Scene embrace(double trunks, double before, double aside, int frames) {
  Scene s = facing(trunks, frames);
  s.performer.rhand = test::still({trunks - before, aside, 1.25}, frames);
  return s;
}

TEST(ActRule, HugAsksForCloseTrunksAndAHandRoundThePartnerForHalfASecond) {
  EXPECT_TRUE(accepts(Task::kHug, embrace(0.3, -0.1, 0.1, 25)));
  EXPECT_FALSE(accepts(Task::kHug, embrace(0.3, -0.1, 0.1, 24)));
  EXPECT_TRUE(accepts(Task::kHug, embrace(0.44, -0.1, 0.1, 25)));
  EXPECT_FALSE(accepts(Task::kHug, embrace(0.46, -0.1, 0.1, 25)));
  EXPECT_TRUE(accepts(Task::kHug, embrace(0.3, 0.19, 0.1, 25)));
  EXPECT_FALSE(accepts(Task::kHug, embrace(0.3, 0.21, 0.1, 25)));
  EXPECT_TRUE(accepts(Task::kHug, embrace(0.3, 0.0, 0.54, 25)));
  EXPECT_FALSE(accepts(Task::kHug, embrace(0.3, 0.0, 0.56, 25)));
}

// The two conditions hold each for a second, together only for 0.4 s.
TEST(ActRule, HugAsksForBothAtOnce) {
  Scene s = embrace(0.3, -0.1, 0.1, 80);
  for (int t = 50; t < 80; ++t) s.partner.torso.col(t) += Eigen::Vector3d(0.5, 0.0, 0.0);
  for (int t = 0; t < 30; ++t) s.performer.rhand.col(t) = Eigen::Vector3d(0.1, -0.25, 0.8);
  for (int t = 50; t < 80; ++t) s.performer.rhand.col(t) += Eigen::Vector3d(0.5, 0.0, 0.0);
  EXPECT_FALSE(accepts(Task::kHug, s));
  const DetectorResult result = detect(Task::kHug, s.performer, s.partner, DetectorVersion::kPaper, ThresholdSet::kAct);
  EXPECT_TRUE(result.parts.at("trunks_close"));
  EXPECT_TRUE(result.parts.at("hand_round"));
}

// Both hands on the chest, then away: what the printed detector takes for a hug.
TEST(ActRule, APushIsNoHug) {
  Scene s = facing(0.62, 100);
  for (int t = 30; t < 60; ++t) {
    s.performer.lhand.col(t) = Eigen::Vector3d(0.5, 0.12, 1.3);
    s.performer.rhand.col(t) = Eigen::Vector3d(0.5, -0.12, 1.3);
  }
  EXPECT_TRUE(detect(Task::kHug, s.performer, s.partner, DetectorVersion::kPaper).success);
  EXPECT_FALSE(accepts(Task::kHug, s));
}

// Two who pass by one another, hands hanging.
TEST(ActRule, StandingCloseIsNoHug) { EXPECT_FALSE(accepts(Task::kHug, facing(0.3, 100))); }

TEST(ActRule, TheOneWhoIsHuggedHugsNobody) {
  const Scene s = embrace(0.3, -0.1, 0.1, 50);
  EXPECT_TRUE(accepts(Task::kHug, s));
  EXPECT_FALSE(accepts(Task::kHug, {s.partner, s.performer}));
}

// ---- hands that meet

struct Clasp {
  int frames = 40;
  double apart = 0.05;   // of the hands [m]
  double shake = 0.03;   // of both, about two times up and down, half the way [m]
  double rise = 0.0;     // of both, from the first frame to the last [m]
  double height = -0.3;  // of their middle in the beginning, over the shoulders [m]
  double trunks = 1.0;   // [m]
  bool crossed = false;  // the performer's right with the partner's left
  bool only_one_moves = false;
};

// The hands are together all the time.
Scene clasped(const Clasp& clasp) {
  Scene s = facing(clasp.trunks, clasp.frames);
  for (int t = 0; t < clasp.frames; ++t) {
    const double way = 1.0 * t / (clasp.frames - 1);
    const double rise = clasp.rise * way + clasp.shake * std::sin(2.25 * 2.0 * std::numbers::pi * way);
    const Eigen::Vector3d middle(0.5 * clasp.trunks, 0.0, 0.9 + kShoulders + clasp.height);
    const Eigen::Vector3d aside(0.0, 0.5 * clasp.apart, 0.0);
    s.performer.rhand.col(t) = middle - aside + Eigen::Vector3d(0.0, 0.0, rise);
    Eigen::Matrix3Xd& other = clasp.crossed ? s.partner.lhand : s.partner.rhand;
    other.col(t) = middle + aside + Eigen::Vector3d(0.0, 0.0, clasp.only_one_moves ? 0.0 : rise);
  }
  return s;
}

TEST(ActRule, HandshakeAsksForAClaspOfSixTenths) {
  EXPECT_TRUE(accepts(Task::kHandshake, clasped({.frames = 30})));
  EXPECT_FALSE(accepts(Task::kHandshake, clasped({.frames = 29})));
}

TEST(ActRule, HandshakeGoesUpAndDownOrHoldsOn) {
  EXPECT_FALSE(accepts(Task::kHandshake, clasped({.shake = 0.007})));
  EXPECT_FALSE(accepts(Task::kHandshake, clasped({.shake = 0.0, .rise = 0.1}))) << "once, as an object is handed over";
  EXPECT_FALSE(accepts(Task::kHandshake, clasped({.only_one_moves = true})));
  EXPECT_TRUE(accepts(Task::kHandshake, clasped({.frames = 60, .shake = 0.0})));
  EXPECT_FALSE(accepts(Task::kHandshake, clasped({.frames = 59, .shake = 0.0})));
}

TEST(ActRule, HandshakeOfALeftWithARightHandTakesLonger) {
  EXPECT_TRUE(accepts(Task::kHandshake, clasped({.frames = 55, .crossed = true})));
  EXPECT_FALSE(accepts(Task::kHandshake, clasped({.frames = 54, .crossed = true})));
  EXPECT_TRUE(accepts(Task::kHandshake, clasped({.frames = 54})));
}

// Rocket and parachute: fists that travel together.
TEST(ActRule, HandshakeStaysInPlace) {
  EXPECT_TRUE(accepts(Task::kHandshake, clasped({.frames = 70, .shake = 0.0, .rise = 0.34, .height = -0.5})));
  EXPECT_FALSE(accepts(Task::kHandshake, clasped({.frames = 70, .shake = 0.0, .rise = 0.38, .height = -0.5})));
  EXPECT_TRUE(accepts(Task::kHandshake, clasped({.shake = 0.2, .height = -0.5}))) << "people of K3HI shake by 0.5 m";
}

TEST(ActRule, HandshakeIsBelowTheShoulders) {
  EXPECT_TRUE(accepts(Task::kHandshake, clasped({.height = -0.02})));
  EXPECT_FALSE(accepts(Task::kHandshake, clasped({.height = 0.02})));
}

TEST(ActRule, HandshakeIsAtArmsLength) {
  EXPECT_TRUE(accepts(Task::kHandshake, clasped({.trunks = 0.51})));
  EXPECT_FALSE(accepts(Task::kHandshake, clasped({.trunks = 0.49})));
}

TEST(ActRule, HandsThatNeverComeNearCountWhereTheyStaySteady) {
  EXPECT_TRUE(accepts(Task::kHandshake, clasped({.apart = 0.29})));
  EXPECT_FALSE(accepts(Task::kHandshake, clasped({.apart = 0.31})));
  for (const double farther : {0.05, 0.07}) {  // for half of the time
    Scene s = clasped({.frames = 50, .apart = 0.22});
    for (int t = 25; t < 50; ++t) s.performer.rhand.col(t).y() -= farther;
    EXPECT_EQ(accepts(Task::kHandshake, s), farther < 0.06) << farther;
  }
}

// A giver's hand comes, waits for the taker's and goes.
TEST(ActRule, AnObjectThatIsHandedOverIsNoHandshake) {
  Scene s = clasped({.frames = 100, .apart = 0.12, .shake = 0.0, .rise = 0.02, .crossed = true});
  for (int t = 0; t < 100; ++t)
    if (t < 20 || t >= 65) s.performer.rhand.col(t) = Eigen::Vector3d(0.1, -0.25, 1.0);
  EXPECT_TRUE(detect(Task::kHandshake, s.performer, s.partner, DetectorVersion::kPaper).success);
  EXPECT_FALSE(accepts(Task::kHandshake, s));
}

TEST(ActRule, HighFiveIsShort) {
  EXPECT_TRUE(accepts(Task::kHighFive, clasped({.frames = 50, .rise = 0.0, .height = 0.1})));
  EXPECT_FALSE(accepts(Task::kHighFive, clasped({.frames = 51, .rise = 0.0, .height = 0.1})));
}

TEST(ActRule, HighFiveIsUp) {
  EXPECT_TRUE(accepts(Task::kHighFive, clasped({.shake = 0.0, .height = -0.27 * kAdultArm})));
  EXPECT_FALSE(accepts(Task::kHighFive, clasped({.shake = 0.0, .height = -0.29 * kAdultArm})));
  for (const double over :
       {-0.34 * kAdultArm, -0.36 * kAdultArm}) {  // a small performer: its hand is up, the partner's is not
    Scene s = clasped({.shake = 0.0, .height = over});
    for (Eigen::Matrix3Xd* shoulder : {&s.performer.lshoulder, &s.performer.rshoulder}) shoulder->row(2).array() -= 0.4;
    EXPECT_EQ(accepts(Task::kHighFive, s), over > -0.35 * kAdultArm) << over;
  }
}

TEST(ActRule, HighFiveHasContactAtArmsLength) {
  EXPECT_TRUE(accepts(Task::kHighFive, clasped({.apart = 0.19, .rise = 0.0, .height = 0.1})));
  EXPECT_FALSE(accepts(Task::kHighFive, clasped({.apart = 0.21, .rise = 0.0, .height = 0.1})));
  EXPECT_TRUE(accepts(Task::kHighFive, clasped({.rise = 0.0, .height = 0.1, .trunks = 0.51})));
  EXPECT_FALSE(accepts(Task::kHighFive, clasped({.rise = 0.0, .height = 0.1, .trunks = 0.49})));
}

struct Bump {
  double speed = 1.0;  // of the performer's fist before the touch [m/s]
  int touch = 20;      // frames
  double apart = 0.1;  // of the fists in the touch [m]
  double away = 0.4;   // afterwards [m]
  double rise = 0.0;   // of both fists in the touch [m]
  double height = -0.3, trunks = 1.0;
};

Scene bumped(const Bump& bump) {
  constexpr int kBefore = 40, kAfter = 40;
  Scene s = clasped({.frames = kBefore + bump.touch + kAfter,
                     .apart = bump.apart,
                     .shake = 0.0,
                     .height = bump.height,
                     .trunks = bump.trunks});
  for (int t = 0; t < s.performer.rhand.cols(); ++t) {
    if (t < kBefore) s.performer.rhand.col(t).y() -= (kBefore - t) * bump.speed / 50.0;
    if (t >= kBefore + bump.touch) s.performer.rhand.col(t).y() -= bump.away - bump.apart;
    const double rise = bump.rise * std::clamp((t - kBefore) / (bump.touch - 1.0), 0.0, 1.0);
    s.performer.rhand(2, t) += rise;
    s.partner.rhand(2, t) += rise;
  }
  return s;
}

TEST(ActRule, FistBumpIsQuickShortAndParts) {
  const Task fist_bump = parse_task("fist_bump");
  EXPECT_TRUE(accepts(fist_bump, bumped({})));
  EXPECT_FALSE(accepts(fist_bump, bumped({.speed = 0.4})));
  EXPECT_TRUE(accepts(fist_bump, bumped({.speed = 0.6})));
  EXPECT_FALSE(accepts(fist_bump, bumped({.touch = 75})));
  EXPECT_TRUE(accepts(fist_bump, bumped({.touch = 50})));
  EXPECT_FALSE(accepts(fist_bump, bumped({.away = 0.29})));
  EXPECT_TRUE(accepts(fist_bump, bumped({.away = 0.31})));
  EXPECT_FALSE(accepts(fist_bump, bumped({.apart = 0.16})));
  EXPECT_FALSE(accepts(fist_bump, bumped({.rise = 0.09})));
  EXPECT_TRUE(accepts(fist_bump, bumped({.rise = 0.03})));
  EXPECT_FALSE(accepts(fist_bump, bumped({.height = 0.0})));
  EXPECT_TRUE(accepts(fist_bump, bumped({.height = -0.1})));
  EXPECT_FALSE(accepts(fist_bump, bumped({.trunks = 0.49})));
  EXPECT_TRUE(accepts(fist_bump, bumped({.trunks = 0.51})));
  EXPECT_FALSE(accepts(fist_bump, clasped({.frames = 100})));  // a handshake
}

TEST(ActRule, FistBumpTouches) {
  const Task fist_bump = parse_task("fist_bump");
  const Scene s = bumped({});
  const double together = detect_by_rule(fist_bump, s.performer, s.partner, {}).values.at("together_s");
  for (const double more : {0.01, -0.01})
    EXPECT_EQ(detect_by_rule(fist_bump, s.performer, s.partner, {{"shortest", together + more}}).success, more < 0.0);
}

// A left and a right hand, equally good, are no bump.
TEST(ActRule, FistBumpIsOfOneSide) {
  Scene s = bumped({});
  std::swap(s.partner.lhand, s.partner.rhand);
  EXPECT_FALSE(accepts(parse_task("fist_bump"), s));
  EXPECT_TRUE(detect_by_rule(parse_task("fist_bump"), s.performer, s.partner, {{"one_side", 0.0}}).success);
}

// One hand in three acts: each belongs to one of them.
TEST(ActRule, ClaspBumpAndHighFiveAreThreeActs) {
  const Task fist_bump = parse_task("fist_bump");
  const Scene clasp = clasped({.frames = 80}), bump = bumped({}), five = bumped({.height = 0.15});
  EXPECT_TRUE(accepts(Task::kHandshake, clasp) && !accepts(fist_bump, clasp) && !accepts(Task::kHighFive, clasp));
  EXPECT_TRUE(!accepts(Task::kHandshake, bump) && accepts(fist_bump, bump) && !accepts(Task::kHighFive, bump));
  EXPECT_TRUE(!accepts(Task::kHandshake, five) && !accepts(fist_bump, five) && accepts(Task::kHighFive, five));
}

// ---- wave

struct Waving {
  double rate_hz = 2.0, reach = 0.1, height = 0.1;  // half the way of a swing, over the shoulders [m]
  double seconds = 2.0;
  Eigen::Vector3d along = Eigen::Vector3d::UnitY();  // the arm points ahead, 0.3 m
};

Scene waved(const Waving& w) {
  const int frames = static_cast<int>(50 * w.seconds) + 1;
  Scene s = facing(1.5, frames);
  for (int t = 0; t < frames; ++t)
    s.performer.rhand.col(t) = Eigen::Vector3d(0.3, -0.17, 0.9 + kShoulders + w.height) +
                               w.reach * std::sin(2.0 * std::numbers::pi * w.rate_hz * t / 50.0) * w.along;
  return s;
}

TEST(ActRule, WaveSwingsOnEnd) {
  EXPECT_TRUE(accepts(Task::kWave, waved({})));
  EXPECT_FALSE(accepts(Task::kWave, waved({.reach = 0.012}))) << "trembling";
  EXPECT_FALSE(accepts(Task::kWave, waved({.seconds = 0.5}))) << "too few";
  EXPECT_FALSE(accepts(Task::kWave, waved({.rate_hz = 0.5, .seconds = 8.0}))) << "too slow";
  EXPECT_TRUE(accepts(Task::kWave, waved({.rate_hz = 0.9, .seconds = 8.0})));
}

TEST(ActRule, WaveIsUp) {
  EXPECT_TRUE(accepts(Task::kWave, waved({.height = -0.29 * kAdultArm})));
  EXPECT_FALSE(accepts(Task::kWave, waved({.height = -0.31 * kAdultArm})));
}

// A hand that is raised and held: the way up and the way down are no swings.
TEST(ActRule, ARaisedHandIsNoWave) {
  Scene s = waved({.reach = 0.0, .seconds = 4.0});
  for (const int begin : {0, 170})
    for (int t = 0; t < 30; ++t)
      s.performer.rhand.col(begin + t) = Eigen::Vector3d(0.3, -0.17, 0.8 + (begin == 0 ? t : 30 - t) * 0.65 / 30.0);
  EXPECT_FALSE(accepts(Task::kWave, s));
}

// Near the partner they push or punch, with both hands up they do not wave.
TEST(ActRule, WaveIsClearOfThePartnerAndOfOneHand) {
  Scene s = waved({});
  s.partner = test::standing({0.7, 0.0, 0.9}, -1.0, static_cast<int>(s.performer.root.cols()));
  EXPECT_FALSE(detect_by_rule(Task::kWave, s.performer, s.partner, {}).parts.at("clear"));
  s = waved({});
  s.performer.lhand = s.performer.rhand;
  s.performer.lhand.row(1).array() += 0.4;
  EXPECT_FALSE(detect_by_rule(Task::kWave, s.performer, s.partner, {}).parts.at("one_hand"));
}

TEST(ActRule, WaveCountsSwings) {
  const Scene s = waved({});
  const DetectorResult judged = detect_by_rule(Task::kWave, s.performer, s.partner, {});
  EXPECT_GE(judged.values.at("swings"), 6);
  EXPECT_LE(judged.values.at("swings"), 8);
  const double swings = judged.values.at("swings"), clear = judged.values.at("clear");
  const auto with = [&](const Thresholds& tau) {
    return detect_by_rule(Task::kWave, s.performer, s.partner, tau).success;
  };
  EXPECT_TRUE(with({{"swings", swings}}));
  EXPECT_FALSE(with({{"swings", swings + 1}}));
  EXPECT_TRUE(with({{"clear", clear - 0.1}}));
  EXPECT_FALSE(with({{"clear", clear + 0.1}}));
}

// ---- bend

struct Bowing {
  double degrees = 45.0, seconds = 2.0;
  bool returns = true, back = false;
  double trunks = 1.2;
};

Scene bowed(const Bowing& bow) {
  const int frames = static_cast<int>(50 * bow.seconds) + 101;
  Scene s = facing(bow.trunks, frames);
  for (int t = 0; t < frames; ++t) {
    double share = std::clamp((t - 25) / 25.0, 0.0, 1.0);
    if (bow.returns) share = std::min(share, std::clamp((frames - 25 - t) / 25.0, 0.0, 1.0));
    const double angle = (bow.back ? -1.0 : 1.0) * share * bow.degrees * std::numbers::pi / 180.0;
    s.performer.head.col(t) = Eigen::Vector3d(0.65 * std::sin(angle), 0.0, 0.9 + 0.65 * std::cos(angle));
  }
  return s;
}

TEST(ActRule, BowIsDeepTowardsThePartnerAndBack) {
  EXPECT_TRUE(accepts(Task::kBend, bowed({})));
  EXPECT_FALSE(accepts(Task::kBend, bowed({.degrees = 28.0}))) << "half a bow";
  EXPECT_TRUE(accepts(Task::kBend, bowed({.degrees = 32.0})));
  EXPECT_FALSE(accepts(Task::kBend, bowed({.returns = false}))) << "stays down";
  EXPECT_FALSE(accepts(Task::kBend, bowed({.back = true}))) << "leans back";
  EXPECT_FALSE(accepts(Task::kBend, bowed({.trunks = 0.44}))) << "leans on the partner";
}

// ---- fly-kiss

struct Kissing {
  double at_mouth = 0.5;  // [s]
  double out = 0.5;       // of the hand from its shoulder, towards the partner [m]
  double height = 0.0;    // of the hand that is out, over the shoulder [m]
  double trunks = 1.5;
};

Scene kissed(const Kissing& kiss) {
  const int at_mouth = static_cast<int>(50 * kiss.at_mouth), frames = at_mouth + 140;
  Scene s = facing(kiss.trunks, frames);
  const Eigen::Vector3d hangs(0.1, -0.25, 0.8), mouth(0.12, -0.02, 0.9 + 0.6);
  const Eigen::Vector3d out(kiss.out, -0.17, 0.9 + kShoulders + kiss.height);
  for (int t = 0; t < frames; ++t) {
    const double up = std::clamp((t - 20) / 20.0, 0.0, 1.0), sent = std::clamp((t - 40 - at_mouth) / 20.0, 0.0, 1.0);
    s.performer.rhand.col(t) = hangs + up * (mouth - hangs) + sent * (out - mouth);
  }
  return s;
}

TEST(ActRule, KissIsAtTheMouthAndSent) {
  EXPECT_TRUE(accepts(Task::kFlyKiss, kissed({})));
  const Scene s = kissed({});
  const double stays = detect_by_rule(Task::kFlyKiss, s.performer, s.partner, {}).values.at("mouth_s");
  for (const double more : {0.01, -0.01})
    EXPECT_EQ(detect_by_rule(Task::kFlyKiss, s.performer, s.partner, {{"stays", stays + more}}).success, more < 0.0);
  EXPECT_FALSE(accepts(Task::kFlyKiss, kissed({.out = 0.1}))) << "not sent";
  EXPECT_FALSE(accepts(Task::kFlyKiss, kissed({.height = -0.6}))) << "sinks";
  EXPECT_FALSE(accepts(Task::kFlyKiss, kissed({.trunks = 0.55}))) << "within reach";
}

// ---- all of them

std::vector<std::pair<Task, Scene>> good_acts() {
  return {{Task::kHug, embrace(0.3, -0.1, 0.1, 60)},
          {Task::kHandshake, clasped({.frames = 60})},
          {Task::kHighFive, bumped({.height = 0.15})},
          {Task::kWave, waved({})},
          {Task::kBend, bowed({})},
          {Task::kFlyKiss, kissed({})},
          {parse_task("fist_bump"), bumped({})}};
}

TEST(ActRule, DoesNotAskWhereWhichHandAndAtWhatRate) {
  for (const auto& [task, scene] : good_acts()) {
    EXPECT_TRUE(accepts(task, scene)) << to_string(task);
    EXPECT_TRUE(accepts(task, turned(scene))) << to_string(task) << " turned";
    EXPECT_TRUE(accepts(task, mirrored(scene))) << to_string(task) << " mirrored";
    EXPECT_TRUE(accepts(task, seen_at(scene, 15.0))) << to_string(task) << " at 15 Hz";
    EXPECT_TRUE(accepts(task, seen_at(scene, 30.0))) << to_string(task) << " at 30 Hz";
  }
}

TEST(ActRule, CentimetresOfNoiseDecideNothing) {
  for (const auto& [task, scene] : good_acts()) {
    int accepted = 0;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      Random random(seed, 7);
      Scene noisy = scene;
      for (Agent* agent : {&noisy.performer, &noisy.partner})
        for (Eigen::Matrix3Xd* track : test::tracks_of(*agent))
          for (double& value : track->reshaped()) value += 0.01 * random.normal();
      accepted += accepts(task, noisy) ? 1 : 0;
    }
    EXPECT_GE(accepted, 19) << to_string(task);
  }
}

// Clips of one frame have no meeting, no swing and no hug.
TEST(ActRule, OneFrameIsNoAct) {
  for (const Task task : all_tasks()) {
    if (thresholds(task, ThresholdSet::kAct) == thresholds(task, ThresholdSet::kStrict)) continue;
    EXPECT_FALSE(accepts(task, facing(1.0, 1))) << to_string(task);
  }
}

// The smallest margin has the sign of the verdict.
TEST(ActRule, MarginsSayWhatTheVerdictSays) {
  for (const Task task : all_tasks()) {
    if (thresholds(task, ThresholdSet::kAct) == thresholds(task, ThresholdSet::kStrict)) continue;
    for (const auto& [other, scene] : good_acts()) {
      const DetectorResult result = detect_by_rule(task, scene.performer, scene.partner, {});
      double least = std::numeric_limits<double>::infinity();
      for (const auto& [name, margin] : result.margins) least = std::min(least, margin);
      EXPECT_EQ(result.success, least >= 0.0) << to_string(task) << " of " << to_string(other);
    }
  }
}

}  // namespace
}  // namespace duet
