// Laws of the bodies in every synthesized clip, whatever was drawn.
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "duet/motion/synthesis/synthesis.h"
#include "tests/support.h"

namespace duet {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180.0;
// A joint that stands still moves less than this: rounding of positions of some metres, differenced. [m/s]
constexpr double kStill = 1e-9;

// Every task with three draws and the most unequal couple.
const std::vector<InteractionClip>& clips() {
  static const std::vector<InteractionClip> kClips = [] {
    std::vector<InteractionClip> made;
    for (const Task task : all_tasks()) {
      for (int index = 0; index < 3; ++index) made.push_back(synthesize(task, {.seed = 11, .index = index}));
      made.push_back(synthesize(task, {.seed = 12, .height_a = 1.95, .height_b = 1.5, .speed = 1.2, .style = 1.0}));
    }
    return made;
  }();
  return kClips;
}

void for_everyone(
    const std::function<void(const InteractionClip&, const PointTracks& me, const PointTracks& other)>& check) {
  for (const InteractionClip& clip : clips()) {
    check(clip, clip.a.joints, clip.b.joints);
    check(clip, clip.b.joints, clip.a.joints);
  }
}

double angle(const Vector3d& a, const Vector3d& b) {
  return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0));
}

double flexion(const PointTracks& joints, int t, int upper, int middle, int lower) {
  return angle(joints.at(t, middle) - joints.at(t, upper), joints.at(t, lower) - joints.at(t, middle));
}

double speed(const PointTracks& joints, int t, int joint) {
  return (joints.at(t, joint) - joints.at(t - 1, joint)).norm() * 50.0;
}

double to_torso(const Vector3d& point, const PointTracks& joints, int t) {
  const Vector3d low = joints.at(t, kPelvis), axis = joints.at(t, kNeck) - low;
  const double along = std::clamp((point - low).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
  return (point - low - along * axis).norm();
}

TEST(SynthesisMotion, BonesKeepTheirLengths) {
  for_everyone([](const InteractionClip& clip, const PointTracks& me, const PointTracks&) {
    for (int j = 1; j < kSmplJoints; ++j) {
      const double length = (me.at(0, j) - me.at(0, kSmplParents[j])).norm();
      for (int t = 0; t < me.frames(); ++t)
        ASSERT_NEAR((me.at(t, j) - me.at(t, kSmplParents[j])).norm(), length, 1e-9) << clip.id << " joint " << j;
    }
  });
}

TEST(SynthesisMotion, RotationsCarryTheBones) {
  const InteractionClip& clip = clips().front();
  for (const HumanMotion* motion : {&clip.a, &clip.b})
    for (int j = 1; j < kSmplJoints; ++j) {
      const int parent = kSmplParents[j];
      const auto bone = [&](int t) {
        const Eigen::Quaterniond& q = motion->rotations[static_cast<size_t>(t) * kSmplJoints + parent];
        return Vector3d(q.conjugate() * (motion->joints.at(t, j) - motion->joints.at(t, parent)));
      };
      for (int t = 0; t < motion->frames(); t += 25) ASSERT_LT((bone(t) - bone(0)).norm(), 1e-9) << "joint " << j;
    }
}

TEST(SynthesisMotion, OneFootIsAlwaysPlantedAndFeetTakeTurns) {
  for_everyone([](const InteractionClip& clip, const PointTracks& me, const PointTracks&) {
    std::vector<int> order;  // of the feet that start to swing
    std::array<bool, 2> moving = {false, false};
    std::array<double, 2> highest = {0.0, 0.0};
    for (int t = 1; t < me.frames(); ++t) {
      bool planted = false;
      for (const int side : {0, 1}) {
        const int toe = side == 0 ? kLeftToe : kRightToe;
        const bool moves = speed(me, t, toe) > kStill;
        planted = planted || !moves;
        if (moves && !moving[side]) {
          order.push_back(side);
          highest[side] = 0.0;
        }
        highest[side] = std::max(highest[side], me.at(t, toe).z() - me.at(0, toe).z());
        // A foot that moves is lifted; nothing slides.
        if (!moves) {
          EXPECT_TRUE(!moving[side] || highest[side] > 0.02) << clip.id << " frame " << t;
          EXPECT_NEAR(me.at(t, toe).z(), me.at(0, toe).z(), 1e-12) << clip.id;
        }
        moving[side] = moves;
      }
      ASSERT_TRUE(planted) << clip.id << " frame " << t;
    }
    EXPECT_GE(order.size(), 4u) << clip.id;
  });
}

TEST(SynthesisMotion, FeetStandStillDuringTheActSideBySide) {
  for_everyone([](const InteractionClip& clip, const PointTracks& me, const PointTracks&) {
    for (int t = clip.phases.act_begin + 1; t < clip.phases.act_end; ++t)
      for (const int joint : {kLeftToe, kRightToe, kLeftAnkle, kRightAnkle})
        ASSERT_LT(speed(me, t, joint), kStill) << clip.id << " frame " << t;
    const int t = clip.phases.act_begin;
    const Vector3d apart = me.at(t, kLeftAnkle) - me.at(t, kRightAnkle);
    const double yaw = heading(me, t);
    EXPECT_NEAR(apart.x() * std::cos(yaw) + apart.y() * std::sin(yaw), 0.0, 0.02) << clip.id;
    EXPECT_GT(apart.norm(), 0.12);
    EXPECT_LT(apart.norm(), 0.25);
  });
}

TEST(SynthesisMotion, ArmsSwingAgainstTheLegs) {
  for_everyone([](const InteractionClip& clip, const PointTracks& me, const PointTracks&) {
    double together = 0.0;
    for (int t = 0; t < clip.phases.act_begin - 60; ++t) {
      const double yaw = heading(me, t);
      const Vector3d ahead(std::cos(yaw), std::sin(yaw), 0.0);
      const double feet = (me.at(t, kLeftAnkle) - me.at(t, kRightAnkle)).dot(ahead);
      const double hands = (me.at(t, kLeftHand) - me.at(t, kRightHand)).dot(ahead);
      together += feet * hands;
    }
    EXPECT_LT(together, 0.0) << clip.id;
  });
}

TEST(SynthesisMotion, ThePelvisBobs) {
  for_everyone([](const InteractionClip& clip, const PointTracks& me, const PointTracks&) {
    double lowest = 10.0, highest = 0.0;
    for (int t = 0; t < clip.phases.act_begin; ++t) {
      lowest = std::min(lowest, me.at(t, kPelvis).z());
      highest = std::max(highest, me.at(t, kPelvis).z());
    }
    EXPECT_GT(highest - lowest, 0.01) << clip.id;
    EXPECT_LT(highest - lowest, 0.10) << clip.id;
  });
}

TEST(SynthesisMotion, KneesAndElbowsStayWithinTheirRanges) {
  for_everyone([](const InteractionClip& clip, const PointTracks& me, const PointTracks&) {
    for (int t = 0; t < me.frames(); ++t)
      for (const int side : {0, 1}) {
        const double knee = flexion(me, t, kLeftHip + side, kLeftKnee + side, kLeftAnkle + side);
        const double elbow = flexion(me, t, kLeftShoulder + side, kLeftElbow + side, kLeftWrist + side);
        const double wrist = flexion(me, t, kLeftElbow + side, kLeftWrist + side, kLeftHand + side);
        ASSERT_GT(knee, 8.0 * kDegree) << clip.id << " frame " << t;
        ASSERT_LT(knee, 90.0 * kDegree) << clip.id << " frame " << t;
        ASSERT_GT(elbow, 6.0 * kDegree) << clip.id << " frame " << t;
        ASSERT_LT(elbow, 150.0 * kDegree) << clip.id << " frame " << t;
        ASSERT_LT(wrist, 40.0 * kDegree) << clip.id << " frame " << t;
      }
  });
}

TEST(SynthesisMotion, KneesBendForwardOnly) {
  for_everyone([](const InteractionClip& clip, const PointTracks& me, const PointTracks&) {
    for (int t = 0; t < me.frames(); ++t) {
      const double yaw = heading(me, t);
      const Vector3d ahead(std::cos(yaw), std::sin(yaw), 0.0);
      for (const int side : {0, 1}) {
        const Vector3d middle = 0.5 * (me.at(t, kLeftHip + side) + me.at(t, kLeftAnkle + side));
        ASSERT_GT((me.at(t, kLeftKnee + side) - middle).dot(ahead), 0.0) << clip.id << " frame " << t;
      }
    }
  });
}

TEST(SynthesisMotion, NothingIsFasterThanPeopleAre) {
  for_everyone([](const InteractionClip& clip, const PointTracks& me, const PointTracks&) {
    for (int t = 1; t < me.frames(); ++t)
      for (int j = 0; j < kSmplJoints; ++j)
        ASSERT_LT(speed(me, t, j), 4.2) << clip.id << " frame " << t << " joint " << kSmplNames[j];
  });
}

// A jump in velocity would not shrink with the time step; of a smooth motion the change per frame halves.
TEST(SynthesisMotion, VelocitiesDoNotJump) {
  const auto largest_change = [](const InteractionClip& clip, int begin, int end) {
    double most = 0.0;
    for (const PointTracks* me : {&clip.a.joints, &clip.b.joints})
      for (int t = std::max(begin, 2); t < end; ++t)
        for (int j = 0; j < kSmplJoints; ++j)
          most = std::max(most, (me->at(t, j) - 2.0 * me->at(t - 1, j) + me->at(t - 2, j)).norm() * clip.rate_hz());
    return most;
  };
  for (const Task task : all_tasks()) {
    const InteractionClip coarse = synthesize(task, {.seed = 11, .rate_hz = 50.0});
    const InteractionClip fine = synthesize(task, {.seed = 11, .rate_hz = 200.0});
    const double change = largest_change(coarse, 0, coarse.frames());
    EXPECT_LT(change, 2.0) << to_string(task);
    EXPECT_LT(largest_change(fine, 0, fine.frames()), 0.45 * change) << to_string(task);
    EXPECT_LT(largest_change(fine, fine.phases.act_begin, fine.phases.act_end), 0.45 * change) << to_string(task);
  }
}

TEST(SynthesisMotion, PeopleFaceEachOtherInTheActAndKeepTheirPlace) {
  for_everyone([](const InteractionClip& clip, const PointTracks& me, const PointTracks& other) {
    const Vector3d place = me.at(clip.phases.act_begin, kPelvis);
    for (int t = clip.phases.act_begin; t < clip.phases.act_end; ++t) {
      const Vector3d away = other.at(t, kPelvis) - me.at(t, kPelvis);
      const double off = std::remainder(heading(me, t) - std::atan2(away.y(), away.x()), 2.0 * std::numbers::pi);
      // In a hug they stand a little aside of each other.
      ASSERT_LT(std::abs(off), (clip.task == Task::kHug ? 32.0 : 12.0) * kDegree) << clip.id << " frame " << t;
      // A bow shifts the pelvis back.
      ASSERT_LT((me.at(t, kPelvis) - place).head<2>().norm(), 0.15) << clip.id << " frame " << t;
    }
  });
}

TEST(SynthesisMotion, NobodyIsEverFrozen) {
  for_everyone([](const InteractionClip& clip, const PointTracks& me, const PointTracks&) {
    for (int t = 50; t < me.frames(); t += 50)
      EXPECT_GT((me.at(t, kHead) - me.at(t - 50, kHead)).norm(), 1e-4) << clip.id << " frame " << t;
  });
}

TEST(SynthesisMotion, HandsStayOutsideThePartnersTorsoAndHeadsApart) {
  for_everyone([](const InteractionClip& clip, const PointTracks& me, const PointTracks& other) {
    const double radius = 0.072 * 1.6;  // of a small torso; more than 3 cm inside is through it
    for (int t = 0; t < me.frames(); ++t) {
      for (const int hand : {kLeftHand, kRightHand, kLeftWrist, kRightWrist})
        ASSERT_GT(to_torso(me.at(t, hand), other, t), radius - 0.03) << clip.id << " frame " << t;
      ASSERT_GT((me.at(t, kHead) - other.at(t, kHead)).norm(), 0.15) << clip.id << " frame " << t;
    }
  });
}

TEST(SynthesisMotion, BowsGoFromThirtyToSixtyDegreesAndAreHeld) {
  for (int index = 0; index < 12; ++index) {
    const InteractionClip clip = synthesize(Task::kBend, {.index = index});
    for (const HumanMotion* person : {&clip.a, &clip.b}) {
      double deepest = 0.0;
      int held = 0;
      for (int t = 0; t < clip.frames(); ++t) {
        const Vector3d trunk = person->joints.at(t, kHead) - person->joints.at(t, kPelvis);
        deepest = std::max(deepest, angle(trunk, Vector3d::UnitZ()));
        held += angle(trunk, Vector3d::UnitZ()) > 30.0 * kDegree;
      }
      EXPECT_GT(deepest, 30.0 * kDegree) << clip.id;
      EXPECT_LT(deepest, 61.0 * kDegree) << clip.id;
      EXPECT_GT(held, 25) << clip.id;
    }
  }
}

TEST(SynthesisMotion, TheReactorFollowsTheActor) {
  for (const Task task : {Task::kWave, Task::kBend, Task::kFlyKiss, Task::kHandshake})
    for (int index = 0; index < 5; ++index) {
      const InteractionClip clip = synthesize(task, {.index = index});
      // First frame of the act at which hands or head have moved by 6 cm from where they were at its beginning.
      const auto first = [&](const PointTracks& me) {
        for (int t = clip.phases.act_begin; t < clip.phases.act_end; ++t)
          for (const int joint : {kLeftHand, kRightHand, kHead})
            if ((me.at(t, joint) - me.at(clip.phases.act_begin, joint)).norm() > 0.06) return t;
        return clip.phases.act_end;
      };
      EXPECT_LT(first(clip.a.joints), first(clip.b.joints)) << clip.id;
      EXPECT_LT(first(clip.b.joints), clip.phases.act_end) << clip.id;
    }
}

// How far a hand goes from where it hangs, seen from the root, in frames [begin, end).
double hand_way(const HumanMotion& person, int begin, int end) {
  double way = 0.0;
  for (int t = begin; t < end; ++t)
    for (const int hand : {kLeftHand, kRightHand}) {
      const auto of_root = [&](int at) { return Vector3d(person.joints.at(at, hand) - person.joints.at(at, kPelvis)); };
      way = std::max(way, (of_root(t) - of_root(begin)).norm());
    }
  return way;
}

TEST(SynthesisMotion, OnlyWhoIsKissedCatchesTheKiss) {
  int caught = 0;
  for (int index = 0; index < 12; ++index) {
    const InteractionClip clip = synthesize(Task::kFlyKiss, {.index = index});
    if (clip.source.at("b.catches") != "yes") continue;
    ++caught;
    EXPECT_LT(hand_way(clip.a, clip.phases.act_begin - 50, clip.phases.act_begin), 0.28)
        << clip.id;  // swings as he walks
  }
  EXPECT_GT(caught, 1);
}

}  // namespace
}  // namespace duet
