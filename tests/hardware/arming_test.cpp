#include <gtest/gtest.h>

#include "duet/hardware/executors/executor.h"
#include "tests/support.h"

namespace duet {
namespace {

ArmingFacts everything_there() {
  ArmingFacts facts;
  facts.permission = {.allow_motion = true, .robot = "E21-1", .interface = "eth1", .domain = 0, .mode_machine = 5};
  facts.executor = ExecutorKind::kHomieLcm;
  facts.odometry = OdometrySource::kLegs;
  facts.asked_to_arm = true;
  facts.contact_limits.name = "iso_ts_15066";
  facts.contact_limits.verified_by = "somebody";
  facts.shown_nonce = facts.typed_nonce = "kestrel";
  facts.shown_at = 10.0;
  facts.now = 15.0;
  facts.remote_key_held = true;
  facts.reported_mode_machine = 5;
  facts.free_log_bytes = 2e9;
  facts.log_is_open = true;
  return facts;
}

std::string refusal(const std::function<void(ArmingFacts&)>& spoil) {
  ArmingFacts facts = everything_there();
  spoil(facts);
  return arming_refusal(facts);
}

TEST(Arming, IsAllowedWhereEverythingIsThere) { EXPECT_EQ(arming_refusal(everything_there()), ""); }

TEST(Arming, OfATwinNeedsNoSignatureButItsOwnDomains) {
  ArmingFacts facts = everything_there();
  facts.twin = true;
  facts.executor = ExecutorKind::kTwin;
  facts.odometry = OdometrySource::kTwin;
  facts.permission.domain = 123;
  facts.permission.interface = "lo";
  facts.contact_limits.verified_by = "";
  EXPECT_EQ(arming_refusal(facts), "");
}

TEST(Arming, IsRefusedInADryRun) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.dry_run = true; }));
}

TEST(Arming, IsRefusedUnasked) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.asked_to_arm = false; }));
}

TEST(Arming, NeedsAConfigurationThatAllowsMotionAndNamesEverything) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.permission.allow_motion = false; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.permission.robot = ""; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.permission.domain = -1; }));
  for (const char* interface : {"", "auto"})
    EXPECT_SENTENCE(refusal([=](ArmingFacts& f) { f.permission.interface = interface; }));
}

TEST(Arming, ATwinIsNotARobot) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.twin = true; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.permission.domain = 100; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) {
    f.permission.domain = 1;
    f.permission.interface = "lo";
  }));
}

TEST(Arming, NeedsTheRobotThatIsConfigured) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.reported_mode_machine = 6; }));
}

TEST(Arming, OfARobotNeedsContactLimitsThatSomebodySigned) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.contact_limits.verified_by = ""; }));
}

TEST(Arming, OfARobotNeedsAnExecutorAndOdometryOfARobot) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.executor = ExecutorKind::kTwin; }));
  EXPECT_EQ(refusal([](ArmingFacts& f) { f.executor = ExecutorKind::kLowcmd; }), "") << "a robot's own motors";
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) {
    f.executor = ExecutorKind::kLowcmd;
    f.odometry = OdometrySource::kVendor;
  }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.odometry = OdometrySource::kTwin; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.odometry = OdometrySource::kNone; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.odometry = OdometrySource::kVendor; }));
  EXPECT_EQ(refusal([](ArmingFacts& f) {
              f.executor = ExecutorKind::kSport;
              f.odometry = OdometrySource::kVendor;
            }),
            "");
}

TEST(Arming, NeedsAnExecutorThatIsWell) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.executor_complaint = "it is silent"; }));
}

TEST(Arming, NeedsALogThatCanBeWritten) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.log_is_open = false; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.free_log_bytes = 0.9e9; }));
}

TEST(Arming, NeedsTheWordOnTheScreenInTime) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.typed_nonce = "heron"; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.typed_nonce = f.shown_nonce = ""; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.now = f.shown_at + 30.0; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.now = f.shown_at - 1.0; }));
  EXPECT_EQ(refusal([](ArmingFacts& f) { f.now = f.shown_at + 29.9; }), "");
}

TEST(Arming, NeedsTheKeyOnTheRemoteControl) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.remote_key_held = false; }));
}

}  // namespace
}  // namespace duet
