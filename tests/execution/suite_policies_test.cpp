// Policies of a suite: options, prompts, partners of other clips, and those that are not on this machine.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/embodiments.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/rollout/act_episode.h"
#include "tests/execution/staged.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

Suite with_policies(const std::string& list) {
  return parse_suite(
      "schema: duet.suite/1\nname: p\nversion: 1.0.0\nclips: {synth: {per_task: 2}}\ntasks: [wave]\n"
      "engines: [playback]\ncontrollers: [pd]\npolicies: " +
          list + "\nstart: act\n",
      "p.yaml");
}

std::string refusal(const std::string& list) {
  return test::thrown_message<InputError>([&] { with_policies(list); });
}

bool has_dstar() {
  const std::vector<std::string> names = policy_names();
  return std::find(names.begin(), names.end(), "dstar") != names.end();
}

TEST(SuitePolicies, ANameIsAPolicyWithoutOptions) {
  const Suite suite = with_policies("[replay, replay_dense]");
  EXPECT_EQ(suite.policy_names(), (std::vector<std::string>{"replay", "replay_dense"}));
  EXPECT_EQ(suite.policies[1].use, "replay_dense");
  EXPECT_FALSE(suite.policies[1].shuffled_partner);
  EXPECT_THAT(resolved_yaml(suite), HasSubstr("\npolicies: [replay, replay_dense]\n"));
}

TEST(SuitePolicies, AMappingSetsPromptAndPartner) {
  const Suite suite =
      with_policies("[replay, {name: blind, use: replay, prompt: 'say \"hi\" \\ now', partner: shuffled}]");
  ASSERT_EQ(suite.policies.size(), 2U);
  EXPECT_EQ(suite.policies[1].use, "replay");
  EXPECT_EQ(suite.policies[1].prompt, "say \"hi\" \\ now");
  EXPECT_TRUE(suite.policies[1].shuffled_partner);
  const Suite again = parse_suite(resolved_yaml(suite), "again.yaml");
  EXPECT_EQ(again.policies[1].prompt, suite.policies[1].prompt);
  EXPECT_EQ(resolved_yaml(again), resolved_yaml(suite));
  EXPECT_NE(identity_of(suite.policies[1]).digest,
            identity_of(with_policies("[replay, {name: blind, use: replay}]").policies[1]).digest);
}

TEST(SuitePolicies, WhatIsWrongIsNamedWithItsLine) {
  for (const char* text :
       {"[replya]", "[replay, replay]", "[{use: replay}]", "[{name: 'a b', use: replay}]",
        "[{name: x, use: replay, parnter: own}]", "[{name: x, use: replay, partner: other}]",
        "[{name: x, use: replay, options: {a: 1}}]", "[{name: x, use: replay, network: a.st}]",
        "[{name: x, use: replay, options: [1]}]", "[{name: x, use: replay, options: {network: a}, network: b}]",
        "[{name: 'null', use: replay}]", "[]"})
    EXPECT_SENTENCE(refusal(text));
}

std::string process_descriptor(const std::string& name, const std::string& how = "command: [/bin/false]\n") {
  return "schema: duet.policy/1\nname: " + name + "\nabout: a test\nkind: process\n" + how;
}

TEST(SuitePolicies, TheNameOfADescriptorIsWhatTablesShowUnlessTheSuiteNamesIt) {
  const test::ScratchFolder folder;
  write_file(folder / "file.yaml", process_descriptor("mywave"));
  EXPECT_EQ(with_policies("[" + (folder / "file.yaml") + "]").policies.at(0).name, "mywave");
  EXPECT_EQ(with_policies("[{name: other, use: " + (folder / "file.yaml") + "}]").policies.at(0).name, "other");
  const Suite suite = with_policies("[" + (folder / "file.yaml") + "]");
  EXPECT_EQ(parse_suite(resolved_yaml(suite), "again.yaml").policies.at(0).name, "mywave");
  write_file(folder / "same.yaml", process_descriptor("mywave"));
  EXPECT_SENTENCE(refusal("[" + (folder / "file.yaml") + ", " + (folder / "same.yaml") + "]"));
  write_file(folder / "spaces.yaml", process_descriptor("my wave"));
  EXPECT_SENTENCE(refusal("[" + (folder / "spaces.yaml") + "]"));
  EXPECT_SENTENCE(refusal("[" + (folder / "nowhere.yaml") + "]"));
}

TEST(SuitePolicies, TheNameOfAControllersDescriptorIsWhatTablesShow) {
  const test::ScratchFolder folder;
  std::string text = read_file(std::string(DUET_SOURCE_DIR) + "/controllers/descriptors/homie.yaml");
  text.replace(text.find("name: homie"), 11, "name: mine\n");
  write_file(folder / "file.yaml", text);
  const Suite suite = parse_suite(
      "schema: duet.suite/1\nname: p\nversion: 1.0.0\nclips: {synth: {per_task: 2}}\ntasks: [wave]\n"
      "engines: [playback]\ncontrollers: [" +
          (folder / "file.yaml") + "]\npolicies: [replay]\n",
      "p.yaml");
  EXPECT_EQ(suite.controllers.at(0).name, "mine");
}

TEST(SuitePolicies, NullNeedsNoQuotes) {
  for (const char* word : {"[null]", "['null']", "[~, replay]"}) {
    const Suite suite = with_policies(word);
    EXPECT_EQ(suite.policies.at(0).name, "null");
    EXPECT_EQ(resolved_yaml(parse_suite(resolved_yaml(suite), "again.yaml")), resolved_yaml(suite));
  }
}

TEST(SuitePolicies, ProgramsThatAreNotAllowedAreRefusedByNameAndNothingIsMade) {
  const test::ScratchFolder folder;
  write_file(folder / "evil.yaml", process_descriptor("evil", "command: [/bin/sh, -c, \"touch PWNED\"]\n"));
  write_file(folder / "far.yaml", process_descriptor("far", "socket: example.org:7000\n"));
  Suite suite = with_policies("[" + (folder / "evil.yaml") + ", " + (folder / "far.yaml") + ", replay]");
  const std::string message = test::thrown_message<InputError>([&] { Embodiments bodies(suite); });
  EXPECT_SENTENCE(message);
  EXPECT_NO_THROW(Embodiments(suite, {}, {"evil", "far"}));  // what is not run needs no leave
  suite.allow_programs = true;
  EXPECT_NO_THROW(Embodiments{suite});
}

TEST(SuitePolicies, ATrustedFolderAllowsWhatLiesInItAndNoLinkToIt) {
  const test::ScratchFolder trusted, other;
  std::filesystem::create_directory(trusted / "deep");
  write_file(trusted / "deep/mine.yaml", process_descriptor("mine"));
  write_file(other / "mine.yaml", process_descriptor("mine"));
  std::filesystem::create_symlink(trusted / "deep/mine.yaml", other / "link.yaml");
  std::filesystem::create_symlink(other / "mine.yaml", trusted / "link.yaml");
  setenv("DUET_TRUSTED_FOLDERS", (":relative:" + (trusted / "")).c_str(), 1);
  EXPECT_TRUE(in_trusted_folder(trusted / "deep/mine.yaml"));
  EXPECT_FALSE(in_trusted_folder(other / "mine.yaml"));
  EXPECT_FALSE(in_trusted_folder(other / "link.yaml"));    // its program would run in the other folder
  EXPECT_FALSE(in_trusted_folder(trusted / "link.yaml"));  // somebody else's text
  EXPECT_FALSE(in_trusted_folder(trusted / "nowhere.yaml"));
  EXPECT_NO_THROW(Embodiments(with_policies("[" + (trusted / "deep/mine.yaml") + "]")));
  setenv("DUET_TRUSTED_FOLDERS", (trusted / "deep").c_str(), 1);
  EXPECT_TRUE(in_trusted_folder(trusted / "deep/mine.yaml"));
  setenv("DUET_TRUSTED_FOLDERS", (trusted / "dee").c_str(), 1);
  EXPECT_FALSE(in_trusted_folder(trusted / "deep/mine.yaml"));
  unsetenv("DUET_TRUSTED_FOLDERS");
  EXPECT_FALSE(in_trusted_folder(trusted / "deep/mine.yaml"));
}

TEST(SuitePolicies, NetworksAreFoundFromTheSuitesFolderAndCountByContent) {
  if (!has_dstar()) GTEST_SKIP() << "not run: policy dstar absent";
  const test::ScratchFolder folder;
  const auto read = [&](const std::string& file, const std::string& policy) {
    write_file(folder / file,
               "schema: duet.suite/1\nname: p\nversion: 1.0.0\nclips: {synth: {per_task: 2}}\nengines: [playback]\n"
               "controllers: [pd]\npolicies: [" +
                   policy + "]\n");
    return load_suite(folder / file);
  };
  write_file(folder / "a.net", "one");
  write_file(folder / "b.net", "one");
  const Suite a = read("a.yaml", "{name: d, use: dstar, network: a.net}");
  EXPECT_EQ(a.policies[0].options.at("network"), folder / "a.net");
  const Suite b = read("b.yaml", "{name: d, use: dstar, options: {network: b.net}}");
  EXPECT_EQ(identity_of(a.policies[0]).digest, identity_of(b.policies[0]).digest);
  write_file(folder / "a.net", "two");
  EXPECT_NE(identity_of(a.policies[0]).digest, identity_of(b.policies[0]).digest);
}

TEST(SuitePolicies, LibrariesOfRetrievalCountByContentToo) {
  const test::ScratchFolder folder;
  write_file(folder / "windows.st", "one");
  write_file(folder / "p.yaml",
             "schema: duet.suite/1\nname: p\nversion: 1.0.0\nclips: {synth: {per_task: 2}}\nengines: [playback]\n"
             "controllers: [pd]\npolicies: [{name: r, use: retrieval, options: {library: windows.st}}]\n");
  const Suite suite = load_suite(folder / "p.yaml");
  EXPECT_EQ(suite.policies[0].options.at("library"), folder / "windows.st");
  const std::string before = identity_of(suite.policies[0]).digest;
  write_file(folder / "windows.st", "two");
  EXPECT_NE(identity_of(suite.policies[0]).digest, before);
}

TEST(SuitePolicies, APolicyWhoseNetworkIsNotHereIsAbsentAndOthersGoOn) {
  if (!has_dstar()) GTEST_SKIP() << "not run: policy dstar absent";
  const Suite suite = with_policies("[replay, {name: d, use: dstar, network: /nowhere/net.safetensors}]");
  Progress quiet(Progress::Style::kQuiet);
  const test::ScratchFolder folder;
  const RunSummary summary = run_suite(suite, folder / "run", {}, quiet);
  EXPECT_THAT(summary.absent_policies.at("d"), HasSubstr("policy 'd' is absent"));
  EXPECT_EQ(summary.outcomes.at("unsupported"), 2);
  EXPECT_EQ(summary.outcomes.at("ok"), 4);
  RunOptions only;
  only.policies = {"d"};
  EXPECT_SENTENCE(test::thrown_message<MissingError>([&] { run_suite(suite, folder / "other", only, quiet); }));
}

TEST(SuitePolicies, EveryBodyHasAMakerOfEveryPolicy) {
  const Embodiments bodies(with_policies("[replay, {name: second, use: replay}]"), {}, {"replay"});
  EXPECT_EQ(bodies.policy("pd", "second")->make()->name(), "replay");
  EXPECT_EQ(bodies.policy("pd", "null")->make()->name(), "null");
  EXPECT_NE(bodies.policy("pd", "second")->make(), bodies.policy("pd", "second")->make());
  EXPECT_EQ(bodies.policy("pd", "replay"), nullptr);
}

// Remembers what it saw; a plan that may be left out.
class Watcher final : public Policy {
 public:
  [[nodiscard]] std::string_view name() const override { return "watcher"; }
  void reset(const EpisodeContext& context) override {
    prompt = context.prompt;
    start_ = {context.start.X_WB, context.start.q};
  }
  Anchors act(const Observation& observation) override {
    seen.push_back(observation.now().partner);
    Anchors anchors;
    anchors.fill(start_);
    return anchors;
  }
  std::vector<Eigen::Matrix<double, 3, 24>> seen;
  std::string prompt;

 private:
  Reference start_;
};

class ShuffledPartner : public ::testing::Test {
 protected:
  // The first clip's episodes of `replay` and of `blind`, which sees the other clip's partner, are the first two.
  void take_clips(int count) {
    std::vector<PairedMotion> clips;
    for (int i = 0; i < count; ++i) {
      SynthesisOptions options;
      options.index = i;
      clips.push_back(retarget(synthesize(Task::kWave, options), *robot_));
    }
    experiment_ = test::experiment_of(suite_, std::move(clips));
  }
  [[nodiscard]] const std::vector<PairedMotion>& clips() const { return experiment_->bodies().clips("pd"); }
  [[nodiscard]] EpisodeSpec spec(int place) const {
    EpisodeSpec spec = experiment_->at(place);
    spec.seed = 1;
    return spec;
  }
  Rollout watch(const EpisodeSpec& spec, Policy& policy) const { return play_back(experiment_->setup(spec), policy); }

  Suite suite_ = with_policies("[replay, {name: blind, use: replay, partner: shuffled}]");
  std::shared_ptr<const RobotModel> robot_ = test::g1();
  std::shared_ptr<const Experiment> experiment_;
};

TEST_F(ShuffledPartner, IsThatOfTheNextClipOfTheTask) {
  take_clips(2);
  int shuffled = 0;
  for (std::int64_t i = 0; i < experiment_->size(); ++i) {
    const EpisodeSpec spec = experiment_->at(i);
    const std::string& policy = spec.policy->name;
    EXPECT_EQ(spec.arm, policy == "blind" ? "shuffled" : policy == "null" ? "null" : "main");
    if (policy != "blind") {
      EXPECT_EQ(spec.seen, nullptr);
      continue;
    }
    ++shuffled;
    EXPECT_EQ(spec.seen, spec.clip == &clips()[0] ? &clips()[1] : &clips()[0]);
    EXPECT_EQ(experiment_->row(spec).arm, "shuffled");
  }
  EXPECT_EQ(shuffled, 2);
}

TEST_F(ShuffledPartner, IsRefusedWhereATaskHasOneClip) {
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { take_clips(1); }));
}

TEST_F(ShuffledPartner, IsSeenByThePolicyAlone) {
  take_clips(2);
  EpisodeSpec blind = spec(1);
  Watcher own, other;
  const Rollout shuffled = watch(blind, other);
  blind.seen = nullptr;
  const Rollout plain = watch(blind, own);
  EXPECT_EQ(plain.recording.partner, shuffled.recording.partner);
  EXPECT_EQ(plain.state_hash, shuffled.state_hash);
  ASSERT_EQ(own.seen.size(), other.seen.size());
  EXPECT_GT((own.seen.front() - other.seen.front()).norm(), 1e-3);
}

// The policy sees another clip's partner, relative to the robot, as it would in that clip's own episode.
TEST_F(ShuffledPartner, StandsToTheRobotAsInItsOwnClip) {
  take_clips(2);
  const EpisodeSpec there = spec(3), here = spec(1);
  ASSERT_EQ(there.clip, &clips()[1]);
  ASSERT_EQ(here.seen, &clips()[1]);
  const RolloutSetup original = experiment_->setup(there), moved = experiment_->setup(here);
  const Pose &from = original.reference.motion.root.front(), &to = moved.reference.motion.root.front();
  constexpr double kRounding = 1e-9;  // [m]
  for (const int joint : {static_cast<int>(kPelvis), static_cast<int>(kRightHand)}) {
    const Eigen::Vector3d p_W = clips()[1].partner.joints.at(original.reference.clip_frame, joint);
    const Eigen::Vector3d wanted = yaw_rotation(yaw_of(from.R)).conjugate() * (p_W - from.p);
    const Eigen::Vector3d found = yaw_rotation(yaw_of(to.R)).conjugate() * (moved.seen_partner.at(0, joint) - to.p);
    EXPECT_NEAR((wanted - found).head<2>().norm(), 0.0, kRounding);
    EXPECT_EQ(moved.seen_partner.at(0, joint).z(), p_W.z());
  }
}

TEST_F(ShuffledPartner, PromptIsTheTasksUnlessTheSuiteSaysAnother) {
  take_clips(2);
  Watcher watcher;
  watch(spec(0), watcher);
  EXPECT_EQ(watcher.prompt, "wave to the person");
  suite_.policies[0].prompt = "hug them";
  take_clips(2);
  watch(spec(0), watcher);
  EXPECT_EQ(watcher.prompt, "hug them");
}

TEST_F(ShuffledPartner, PromptSaysSoWhereThePartnerDoesNotBegin) {
  take_clips(2);
  PairedMotion still = clips()[0];
  for (int t = 1; t < still.partner.frames(); ++t) still.partner.joints.frame(t) = still.partner.joints.frame(0);
  EpisodeSpec led = spec(0);
  led.clip = &still;
  Watcher watcher;
  watch(led, watcher);
  EXPECT_EQ(watcher.prompt, "wave to the person first");
  still.task = Task::kHandshake;  // which nobody does alone
  watch(led, watcher);
  EXPECT_EQ(watcher.prompt, "shake hands with the person");
}

TEST(SuitePolicies, AnOptionThatIsNoValueIsRefusedWithItsLine) {
  EXPECT_SENTENCE(refusal("\n  - replay\n  - {name: blind, use: replay,\n     options: {prompt: [1]}}"));
}

}  // namespace
}  // namespace duet
