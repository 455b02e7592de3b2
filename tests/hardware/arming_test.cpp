#include <gmock/gmock.h>

#include "duet/hardware/executors/executor.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

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
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.dry_run = true; }), HasSubstr("this is a dry run"));
}

TEST(Arming, IsRefusedUnasked) {
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.asked_to_arm = false; }), HasSubstr("nobody asked to arm"));
}

TEST(Arming, NeedsAConfigurationThatAllowsMotionAndNamesEverything) {
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.permission.allow_motion = false; }), HasSubstr("'allow_motion'"));
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.permission.robot = ""; }), HasSubstr("names no robot"));
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.permission.domain = -1; }), HasSubstr("names no domain"));
  for (const char* interface : {"", "auto"})
    EXPECT_THAT(refusal([=](ArmingFacts& f) { f.permission.interface = interface; }),
                HasSubstr("has to name a network interface"));
}

TEST(Arming, ATwinIsNotARobot) {
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.twin = true; }), HasSubstr("domain 0: a twin has 100 to 199"));
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.permission.domain = 100; }), HasSubstr("domain 100"));
}

TEST(Arming, NeedsTheRobotThatIsConfigured) {
  EXPECT_EQ(refusal([](ArmingFacts& f) { f.reported_mode_machine = 6; }),
            "mode_machine: expected 5 as configured, the robot reports 6");
}

TEST(Arming, OfARobotNeedsContactLimitsThatSomebodySigned) {
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.contact_limits.verified_by = ""; }),
              HasSubstr("nobody has checked them against the standard"));
}

TEST(Arming, OfARobotNeedsAnExecutorAndOdometryOfARobot) {
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.executor = ExecutorKind::kTwin; }),
              HasSubstr("executor 'twin' is a twin's"));
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.odometry = OdometrySource::kTwin; }), HasSubstr("odometry 'twin'"));
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.odometry = OdometrySource::kNone; }),
              HasSubstr("without measured odometry nothing walks"));
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.odometry = OdometrySource::kVendor; }),
              HasSubstr("only while the maker's own walking runs"));
  EXPECT_EQ(refusal([](ArmingFacts& f) {
              f.executor = ExecutorKind::kSport;
              f.odometry = OdometrySource::kVendor;
            }),
            "");
}

TEST(Arming, NeedsAnExecutorThatIsWell) {
  EXPECT_EQ(refusal([](ArmingFacts& f) { f.executor_complaint = "it is silent"; }),
            "executor 'homie-lcm': it is silent");
}

TEST(Arming, NeedsALogThatCanBeWritten) {
  EXPECT_EQ(refusal([](ArmingFacts& f) { f.log_is_open = false; }), "the log cannot be written");
  EXPECT_EQ(refusal([](ArmingFacts& f) { f.free_log_bytes = 0.9e9; }),
            "the disk of the log has 0.90 GB left, expected at least 1");
}

TEST(Arming, NeedsTheWordOnTheScreenInTime) {
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.typed_nonce = "heron"; }), HasSubstr("found 'heron'"));
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.typed_nonce = f.shown_nonce = ""; }), HasSubstr("expected the word"));
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.now = f.shown_at + 30.0; }), HasSubstr("typed after 30.0 s"));
  EXPECT_THAT(refusal([](ArmingFacts& f) { f.now = f.shown_at - 1.0; }), HasSubstr("holds for 30 s"));
  EXPECT_EQ(refusal([](ArmingFacts& f) { f.now = f.shown_at + 29.9; }), "");
}

TEST(Arming, NeedsTheKeyOnTheRemoteControl) {
  EXPECT_EQ(refusal([](ArmingFacts& f) { f.remote_key_held = false; }), "the key on the remote control is not held");
}

}  // namespace
}  // namespace duet
