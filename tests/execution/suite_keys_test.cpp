#include <gmock/gmock.h>

#include <set>

#include "duet/core/require.h"
#include "duet/execution/experiment.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/experiment/suite_file/suite_key.h"
#include "duet/experiment/work/run_work.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/policies/scheduler.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kHead = "schema: duet.suite/1\nname: k\nversion: 1.0.0\n";
constexpr const char* kTail = "engines: [playback]\ncontrollers: [pd]\npolicies: [replay]\n";

Suite suite_with(const std::string& more, const std::string& clips = "clips: {synth: {per_task: 1}}\n") {
  return parse_suite(kHead + clips + kTail + more, "k.yaml");
}

std::string refusal_of(const std::string& more, const std::string& clips = "clips: {synth: {per_task: 1}}\n") {
  return test::thrown_message<InputError>([&] { suite_with(more, clips); });
}

// Suite hashes, and with them published rows, are made of this text: one letter changed gives every suite another.
TEST(SuiteKeys, TheResolvedFormIsWrittenAsItAlwaysWas) {
  EXPECT_EQ(resolved_yaml(suite_with("profile: {schema: duet.profile/1, name: none, engines: {}}\n")),
            "schema: duet.suite/1\nname: k\nversion: \"1.0.0\"\nseed: 10000\n"
            "clips: {synth: {per_task: 1, seed: 42}}\n"
            "tasks: [hug, handshake, high_five, wave, bend, fly_kiss]\nengines: [playback]\ncontrollers: [pd]\n"
            "policies: [replay]\nepisodes_per_clip: 1\nstart: auto\nstart_radius: 1\npartner: ghost\nfuse_ticks: 10\n"
            "profile:\n  name: none\n  engines: {}\ndetector: {version: robot, thresholds: paper}\n"
            "limits: {wall_s_per_episode: 120}\nrecord: {trajectories: none}\nnull_arm: true\n");
  const std::string walk = "reference: {velocity: [0.3, 0, 0]}\n";
  EXPECT_EQ(resolved_yaml(parse_suite(kHead + walk +
                                          "engines: [playback]\ncontrollers: [pd]\n"
                                          "profile: {schema: duet.profile/1, name: none, engines: {}}\n",
                                      "w.yaml")),
            "schema: duet.suite/1\nname: k\nversion: \"1.0.0\"\nseed: 10000\nreference:\n"
            "  - {name: forward_0.3, velocity: [0.3, 0, 0], seconds: 14, begin: 0, end: 14, pause: 0, "
            "upper_body: still}\n"
            "engines: [playback]\ncontrollers: [pd]\nepisodes_per_clip: 1\nprofile:\n  name: none\n  engines: {}\n"
            "limits: {wall_s_per_episode: 120}\nrecord: {trajectories: none}\n");
}

TEST(SuiteKeys, EachIsThereOnceAndSaysWhatItMeans) {
  std::set<std::string> names;
  for (const SuiteKey& key : suite_keys()) {
    EXPECT_TRUE(names.insert(key.name).second) << key.name;
    EXPECT_FALSE(key.rows.empty()) << key.name;
    for (const FieldRow& row : key.rows) {
      EXPECT_TRUE(row.name == key.name || row.name.starts_with(key.name + ".")) << row.name;
      EXPECT_FALSE(row.values.empty()) << row.name;
      EXPECT_FALSE(row.meaning.empty()) << row.name;
    }
  }
}

TEST(SuiteKeys, WhatIsOfClipsIsRefusedBesideAReference) {
  const std::string base = std::string(kHead) +
                           "reference: {velocity: [0, 0, 0]}\nengines: [playback]\n"
                           "controllers: [pd]\n";
  for (const char* key : {"tasks: [hug]", "start: act", "max_root_speed: 1", "retarget: {kernel: v3}"})
    EXPECT_SENTENCE(test::thrown_message<InputError>([&] { parse_suite(base + key + "\n", "w.yaml"); }));
}

TEST(SuiteKeys, TheFuseTicksThatASuiteTakesAreThoseOfTheScheduler) {
  EXPECT_NO_THROW(Scheduler({.fuse_ticks = kMostFuseTicks}));
  EXPECT_THROW(Scheduler({.fuse_ticks = kMostFuseTicks + 1}), std::invalid_argument);
  EXPECT_EQ(suite_with("fuse_ticks: 90\n").fuse_ticks, kMostFuseTicks);
}

TEST(SuiteKeys, TheRootsSpeedHasADefaultThatNoHashSees) {
  const Suite plain = suite_with("");
  EXPECT_EQ(plain.max_root_speed, 1.5);
  EXPECT_THAT(resolved_yaml(plain), Not(HasSubstr("max_root_speed")));
  EXPECT_EQ(suite_hash(suite_with("max_root_speed: 1.5\n")), suite_hash(plain));
  const Suite slow = suite_with("max_root_speed: 0.6\n");
  EXPECT_THAT(resolved_yaml(slow), HasSubstr("\nmax_root_speed: 0.6\n"));
  EXPECT_NE(suite_hash(slow), suite_hash(plain));
  EXPECT_EQ(parse_suite(resolved_yaml(slow), "again.yaml").max_root_speed, 0.6);
  EXPECT_SENTENCE(refusal_of("max_root_speed: 0\n"));
}

TEST(SuiteKeys, PairOptionsAreHeldAgainstEachOther) {
  EXPECT_SENTENCE(refusal_of("retarget: {mode: grounded, root: per-frame}\n"));
  EXPECT_SENTENCE(refusal_of("retarget:\n  w-kin: 1\n  root: free\n"));
}

TEST(SuiteKeys, ClipsMayBePadded) {
  const Suite plain = suite_with("");
  const Suite padded_suite = suite_with("", "clips: {synth: {per_task: 1}, pad: {before: 4, after: 2}}\n");
  EXPECT_EQ(padded_suite.clips.pad.before, 4.0);
  EXPECT_EQ(padded_suite.clips.pad.after, 2.0);
  EXPECT_THAT(resolved_yaml(padded_suite),
              HasSubstr("clips: {synth: {per_task: 1, seed: 42}, pad: {before: 4, after: 2}}\n"));
  EXPECT_THAT(resolved_yaml(plain), Not(HasSubstr("pad")));
  EXPECT_EQ(suite_hash(suite_with("", "clips: {synth: {per_task: 1}, pad: {before: 0}}\n")), suite_hash(plain));
  EXPECT_NE(suite_hash(padded_suite), suite_hash(plain));
  EXPECT_EQ(suite_hash(parse_suite(resolved_yaml(padded_suite), "again.yaml")), suite_hash(padded_suite));
  EXPECT_SENTENCE(refusal_of("", "clips: {synth: {per_task: 1}, pad: {before: -1}}\n"));
  EXPECT_SENTENCE(refusal_of("", "clips: {synth: {per_task: 1}, pad: {befor: 1}}\n"));
}

TEST(SuiteKeys, PaddedClipsAreLongerAndMotionsThatAreMadeAreRefused) {
  const auto robot = test::g1();
  const test::ScratchFolder folder;
  const InteractionClip clip = synthesize(Task::kWave, {});
  save_clip(clip, folder / "clip.npz");
  PairOptions quick;
  quick.schedule.stage1_iterations = 1;
  quick.schedule.stage2_iterations = 0;
  const ClipPadding pad{.before = 1.0, .after = 0.5};
  const PairedMotion longer =
      load_or_retarget(Npz::load(folder / "clip.npz"), *robot, quick, Implausible::kRefused, pad).motion;
  EXPECT_EQ(longer.frames(), clip.frames() + 75);
  EXPECT_EQ(longer.phases.act_begin, clip.phases.act_begin + 50);
  EXPECT_EQ(longer.phases.act_end, clip.phases.act_end + 50);
  save_paired_motion(longer, folder / "paired.npz");
  EXPECT_SENTENCE(test::thrown_message<InputError>(
      [&] { load_or_retarget(Npz::load(folder / "paired.npz"), *robot, quick, Implausible::kRefused, pad); }));
}

}  // namespace
}  // namespace duet
