#include "duet/rollout/yielding_partner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/recording.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/rollout/act_episode.h"
#include "tests/backends/contact_scene.h"
#include "tests/execution/staged.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr int kLeftHandCapsule = 0, kChestCapsule = 1;

// One who can be touched at the left hand and at the chest.
HumanBody body() {
  HumanBody human = test::hand();
  human.capsules.push_back({.name = "lower_chest",
                            .region = "chest",
                            .joint_a = kSpine2,
                            .joint_b = kSpine3,
                            .radius = 0.12,
                            .skin = default_skin("chest")});
  return human;
}

// Arms down but for the left one, whose forearm lies along y, its hand across the way of the sledge's front.
HumanJoints reaching(const Eigen::Vector3d& hand) {
  HumanJoints joints = HumanJoints::Zero();
  for (int j = 0; j < kSmplJoints; ++j) joints.col(j) = hand + Eigen::Vector3d(0.02 * j, 1.0 + 0.01 * j, 0.1);
  joints.col(kSpine2) = hand + Eigen::Vector3d(0.0, 0.5, 0.0);
  joints.col(kSpine3) = hand + Eigen::Vector3d(0.0, 0.5, 0.12);
  joints.col(kNeck) = hand + Eigen::Vector3d(0.0, 0.5, 0.3);
  joints.col(kHead) = hand + Eigen::Vector3d(0.0, 0.5, 0.4);
  joints.col(kLeftShoulder) = hand + Eigen::Vector3d(0.28, 0.75, 0.1);
  joints.col(kLeftElbow) = hand + Eigen::Vector3d(0.0, 0.7, 0.0);
  joints.col(kLeftWrist) = hand + Eigen::Vector3d(0.0, 0.4, 0.0);
  joints.col(kLeftHand) = hand - Eigen::Vector3d(0.0, 0.4, 0.0);
  return joints;
}

Contact pushed(int capsule, const Eigen::Vector3d& point, const Eigen::Vector3d& force_on_person) {
  return {.link = 0, .side = ContactSide::kHuman, .other = capsule, .p_WC = point, .f_W = -force_on_person};
}

constexpr std::array<std::array<int, 2>, 5> kArmsAndHead = {{{kNeck, kHead},
                                                             {kLeftShoulder, kLeftElbow},
                                                             {kLeftElbow, kLeftWrist},
                                                             {kRightShoulder, kRightElbow},
                                                             {kRightElbow, kRightWrist}}};

double worst_bone(const HumanJoints& now, const HumanJoints& wanted) {
  double worst = 0.0;
  for (const auto& [a, b] : kArmsAndHead)
    worst = std::max(worst, std::abs((now.col(a) - now.col(b)).norm() - (wanted.col(a) - wanted.col(b)).norm()));
  return worst;
}

TEST(YieldingPartner, WhomNobodyTouchesIsWhereTheClipHasThem) {
  YieldingPartner partner(body(), 0.002);
  const HumanJoints joints = reaching({0.0, 0.0, 1.0});
  partner.lead(joints, HumanJoints::Constant(0.1));
  partner.step({});
  EXPECT_FALSE(partner.plan());
  EXPECT_EQ(partner.displacement(), HumanJoints::Zero());
}

// The blow of a hand of 0.6 kg on a fixed wall of stiffness K has the peak sqrt(K m) v, whatever the step.
TEST(YieldingPartner, ABlowHasThePeakOfItsMassAndTheSkin) {
  const double speed = 0.5, stiffness = 25000.0;
  HumanBody human = body();
  human.capsules[kLeftHandCapsule].skin = {.stiffness = stiffness, .damping = 0.0};
  for (const double dt : {0.002, 0.001, 0.0005}) {
    YieldingPartner partner(human, dt);
    const Eigen::Vector3d hand(0.0, 0.0, 1.0);
    HumanJoints joints = reaching(hand);
    const HumanJoints velocities = (Eigen::Vector3d(-speed, 0.0, 0.0)).replicate<1, 24>();
    double peak = 0.0, depth = 0.0;
    for (double t = 0.0; t < 0.03; t += dt) {
      partner.lead(joints, velocities);
      partner.plan();
      const Eigen::Vector3d wrist = partner.joints().col(kLeftWrist) + dt * partner.velocities().col(kLeftWrist);
      depth = std::max(0.0, -wrist.x());
      const double force = stiffness * depth;
      peak = std::max(peak, force);
      const Contact contact = pushed(kLeftHandCapsule, wrist, {force, 0.0, 0.0});
      partner.step(std::span(&contact, 1));
      joints += dt * velocities;
    }
    const double expected = std::sqrt(stiffness * kYieldingHandMass) * speed;
    EXPECT_NEAR(peak, expected, 0.1 * expected) << dt;
  }
}

TEST(YieldingPartner, AnImpulseIsTheirMomentum) {
  const double dt = 0.0005;
  YieldingPartner partner(body(), dt);
  const HumanJoints joints = reaching({0.0, 0.0, 1.0});
  partner.lead(joints, HumanJoints::Zero());
  const Eigen::Vector3d force(120.0, -40.0, 0.0);
  const Contact contact = pushed(kLeftHandCapsule, joints.col(kLeftWrist), force);
  partner.step(std::span(&contact, 1));
  ASSERT_TRUE(partner.plan());
  EXPECT_LT((partner.momentum().head<2>() - dt * force.head<2>()).norm(), 0.02 * dt * force.norm());
}

TEST(YieldingPartner, LeftAloneTheyLoseEnergyAndComeBackAndKeepTheirBones) {
  for (const double dt : {0.002, 0.001}) {
    YieldingPartner partner(body(), dt);
    const HumanJoints joints = reaching({0.0, 0.0, 1.0});
    partner.lead(joints, HumanJoints::Zero());
    const auto go = [&](const Eigen::Vector3d& force) {
      const Contact contact = pushed(kLeftHandCapsule, partner.joints().col(kLeftWrist), force);
      partner.step(std::span(&contact, 1));
      partner.plan();
    };
    for (double t = 0.0; t < 0.1; t += dt) {
      go({60.0, -20.0, 30.0});
      EXPECT_LT(worst_bone(partner.joints() + dt * partner.velocities(), joints), 1e-6);
    }
    double before = partner.energy();
    EXPECT_GT(before, 0.1);
    const double most = before;
    partner.step({});
    partner.plan();
    before = partner.energy();
    for (double t = 0.0; t < 6.0; t += dt) {
      partner.step({});
      partner.plan();
      ASSERT_LE(partner.energy(), before * (1.0 + 1e-9) + 1e-15) << dt << " at " << t;
      before = partner.energy();
    }
    EXPECT_LT(before, 0.01 * most);
  }
}

TEST(YieldingPartner, TheTrunkGivesWayByNoMoreThanItsBoundAndNotIntoTheFloor) {
  const double dt = 0.002;
  YieldingPartner partner(body(), dt);
  const HumanJoints joints = reaching({0.0, 0.0, 1.0});
  partner.lead(joints, HumanJoints::Zero());
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d chest = partner.joints().col(kSpine3);
    const Contact contact = pushed(kChestCapsule, chest, {300.0, 400.0, -500.0});
    partner.step(std::span(&contact, 1));
    partner.plan();
    EXPECT_LE(partner.displacement().col(kPelvis).head<2>().norm(), kYieldingMostShift + 1e-12);
    EXPECT_EQ(partner.displacement()(2, kPelvis), 0.0);
  }
  EXPECT_NEAR(partner.displacement().col(kPelvis).head<2>().norm(), kYieldingMostShift, 1e-9);
}

TEST(YieldingPartner, ACopyGoesOnTheSameAndAResetForgets) {
  YieldingPartner partner(body(), 0.002);
  const HumanJoints joints = reaching({0.0, 0.0, 1.0});
  partner.lead(joints, HumanJoints::Zero());
  const Contact contact = pushed(kLeftHandCapsule, joints.col(kLeftWrist), {30.0, 0.0, 0.0});
  partner.step(std::span(&contact, 1));
  partner.plan();
  YieldingPartner copy = partner;
  for (YieldingPartner* one : {&partner, &copy})
    for (int i = 0; i < 20; ++i) {
      one->step({});
      one->plan();
    }
  EXPECT_EQ(partner.joints(), copy.joints());
  EXPECT_GT(partner.displacement().norm(), 0.0);
  partner.reset();
  EXPECT_FALSE(partner.plan());
  EXPECT_EQ(partner.displacement(), HumanJoints::Zero());
}

TEST(YieldingPartner, ALongStepIsRefused) {
  EXPECT_EQ(test::thrown_message<std::invalid_argument>([] { YieldingPartner(body(), 0.004); }),
            "a yielding partner needs a physics step of at most 0.002 s, found 0.004 s");
}

struct EngineYieldingPartner : test::ContactScene, ::testing::WithParamInterface<std::string> {
  EngineYieldingPartner() : ContactScene(GetParam()) {}

  // The hand begins just before the sledge and moves at `speed` towards it.
  void meet(const RobotState& state, double dt, double speed) {
    scene.partner = PartnerMode::kSolid;
    scene.human = body();
    scene.dt = dt;
    start(state);
    joints = reaching(state.X_WB.p + Eigen::Vector3d(0.2 + 0.02 + 0.05 + 1e-6, 0.0, -0.08));
    velocities = Eigen::Vector3d(-speed, 0.0, 0.0).replicate<1, kSmplJoints>();
    partner.emplace(scene.human, dt);
    partner->lead(joints, velocities);
  }
  // The force on the hand [N].
  double go() {
    partner->plan();
    backend->set_partner(partner->joints(), partner->velocities());
    backend->step(test::no_torque(*scene.robot));
    partner->step(backend->contacts());
    return -test::force_of(*backend, ContactSide::kHuman).x();
  }

  HumanJoints joints, velocities;
  std::optional<YieldingPartner> partner;
};
INSTANTIATE_TEST_SUITE_P(Engines, EngineYieldingPartner, ::testing::ValuesIn(test::engine_names()), test::engine_of);

// A hand of 0.6 kg runs into the free sledge at 0.5 m/s: two springs K and dampers D side by side between the two.
// A touch is seen after up to a step, and the person feels it a step later: the peak is above that of fine steps by at
// most what the springs take up on the way of two steps.
TEST_P(EngineYieldingPartner, ABlowIsThatOfTheHandsMass) {
  for (const double dt : {0.002, 0.001, 0.0005}) {
    RobotState flying = rest;
    flying.X_WB.p.z() = 100.0;
    meet(flying, dt, 0.5);
    double impulse = 0.0, peak = 0.0, expected_peak = 0.0;
    for (int i = 0; i < static_cast<int>(std::lround(0.03 / dt)); ++i) {
      const double force = go();
      EXPECT_GE(force, 0.0);  // never pulls
      impulse += dt * force;
      peak = std::max(peak, force);
    }
    const ContactCompliance skin = scene.human.capsules[0].skin;
    const double mobility = 1.0 / test::kMass + 0.08 * 0.08 / 0.5 + 1.0 / kYieldingHandMass;
    for (double t = 0.0, x = 0.0, v = 0.5; t < 0.03; t += 1e-6) {
      const double force = std::max(0.0, 2.0 * (skin.stiffness * x + skin.damping * v));
      v -= 1e-6 * force * mobility;
      x += 1e-6 * v;
      expected_peak = std::max(expected_peak, force);
    }
    EXPECT_NEAR(impulse, -test::kMass * backend->state().v_WB.x(), 1e-6 * test::kMass) << dt;
    EXPECT_GT(peak, 0.98 * expected_peak) << dt;
    EXPECT_LT(peak, expected_peak + 2.0 * skin.stiffness * 2.0 * dt * 0.5) << dt;
    // The same in every engine: the first step in touch has the springs' way and the dampers, less what the sledge
    // gives.
    const double met = 2.0 * (skin.damping + dt * skin.stiffness), sledge = 1.0 / test::kMass + 0.08 * 0.08 / 0.5;
    EXPECT_NEAR(peak, 0.5 * (met + 2.0 * dt * skin.stiffness) / (1.0 + dt * met * sledge), 0.03 * peak) << dt;
    // The hand of a solid person, whom nothing stops, gives the sledge its own speed.
    EXPECT_LT(impulse, 0.5 * 0.5 * test::kMass) << dt;
  }
}

// A hand that wants to be 3 cm inside a sledge that stands fast presses as the arm's springs say, and keeps still.
TEST_P(EngineYieldingPartner, AHandThatPressesComesToRest) {
  scene.friction.robot_ground = 10.0;
  for (const double dt : {0.002, 0.001}) {
    meet(rest, dt, 0.5);
    double least = 1e9, most = 0.0;
    for (int i = 0; i < static_cast<int>(std::lround(4.0 / dt)); ++i) {
      if (i == static_cast<int>(std::lround(0.06 / dt))) {
        joints += 0.06 * velocities;
        partner->lead(joints, HumanJoints::Zero());
      }
      const double force = go();
      if (i * dt < 3.8) continue;
      least = std::min(least, force);
      most = std::max(most, force);
    }
    EXPECT_GT(least, 1.0) << dt;
    EXPECT_LT(most, kYieldingArmStiffness * 2.0 * 0.03) << dt;
    EXPECT_LT(most - least, 0.3) << dt;  // [N]
  }
}

// An episode in mujoco, of `replay` under the plain PD; the suite's partner is as named.
Rollout episode(Task task, SuitePartner partner, bool restarted = false) {
  Suite suite = test::playback_suite();
  suite.engines = {"mujoco"};
  suite.partner = partner;
  suite.start = SuiteStart::kAct;
  const auto robot = test::g1();
  const auto experiment = test::experiment_of(suite, {test::paired(task, *robot)});
  const EpisodeSpec spec = test::first_of(*experiment);
  RolloutSetup setup = experiment->setup(spec);
  const EpisodeRestart restart{{}, 0, setup.start};
  if (restarted) setup.restart = &restart;
  const auto backend = make_backend("mujoco", experiment->scene(spec));
  const auto controller = make_controller("pd", robot);
  const auto policy = make_policy("replay", robot);
  return roll_out(setup, *backend, *controller, *policy);
}

TEST(YieldingPartner, AnEpisodeWithoutATouchIsThatOfASolidOneToTheBit) {
  if (!is_available("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const Rollout solid = episode(Task::kWave, SuitePartner::kSolid),
                yielding = episode(Task::kWave, SuitePartner::kYielding);
  ASSERT_TRUE(std::ranges::none_of(solid.recording.contacts,
                                   [](const auto& contact) { return contact.contact.side == ContactSide::kHuman; }));
  EXPECT_EQ(solid.state_hash, yielding.state_hash);
  EXPECT_EQ(solid.recording.partner, yielding.recording.partner);
}

TEST(YieldingPartner, TheRecordingHasThePersonWhereTheyWerePushed) {
  if (!is_available("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const Rollout solid = episode(Task::kHug, SuitePartner::kSolid),
                yielding = episode(Task::kHug, SuitePartner::kYielding);
  ASSERT_TRUE(std::ranges::any_of(solid.recording.contacts,
                                  [](const auto& contact) { return contact.contact.side == ContactSide::kHuman; }));
  EXPECT_NE(solid.recording.partner, yielding.recording.partner);
  const PointTracks &clip = solid.recording.partner, &pushed = yielding.recording.partner;
  for (int t = 0; t < std::min(clip.frames(), pushed.frames()); ++t)
    ASSERT_LT(worst_bone(pushed.frame(t), clip.frame(t)), 1e-4) << t;
  EXPECT_EQ(episode(Task::kHug, SuitePartner::kYielding).state_hash, yielding.state_hash);
}

TEST(YieldingPartner, AnEpisodeCannotBeTakenUpAgain) {
  if (!is_available("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  EXPECT_EQ(
      test::thrown_message<std::invalid_argument>([] { episode(Task::kHug, SuitePartner::kYielding, true); }),
      "a partner who yields: expected an episode from its start, found one that is taken up again, which does not "
      "say how they moved");
}

}  // namespace
}  // namespace duet
