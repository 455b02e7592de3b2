// Suites whose clips are given: recordings in both roles, beside synthetic ones of the same tasks.
#include <gmock/gmock.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/experiment/work/run_work.h"
#include "tests/app/program.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kRest =
    "engines: [playback]\ncontrollers: [pd]\npolicies: [replay]\nstart: clip\n"
    "retarget: {stage1-iterations: 1, stage2-iterations: 0}\n";

std::string yaml_with(const std::string& clips) {
  return "schema: duet.suite/1\nname: g\nversion: 1.0.0\nclips: " + clips + "\n" + kRest;
}

Suite suite_of(const std::string& clips, const Overrides& overrides = {}) {
  return parse_suite(yaml_with(clips), "g.yaml", overrides);
}

std::string refusal_of_clips(const std::string& clips) {
  return test::thrown_message<InputError>([&] { suite_of(clips); });
}

std::vector<PairedMotion> prepared(const Suite& suite) {
  Progress quiet(Progress::Style::kQuiet);
  return prepare_clips(suite, *test::g1(), 1, quiet);
}

std::vector<std::string> ids_of(const std::vector<PairedMotion>& clips) {
  std::vector<std::string> ids;
  ids.reserve(clips.size());
  for (const PairedMotion& clip : clips) ids.push_back(clip.clip_id);
  return ids;
}

class GivenClips : public ::testing::Test {
 protected:
  // A recording stands in: a synthetic clip under another name.
  std::string recording(const std::string& id, Task task = Task::kWave) {
    SynthesisOptions options;
    options.like = Likeness::kPeople;
    options.outcome = ActOutcome::kComplete;
    InteractionClip clip = synthesize(task, options);
    clip.id = id;
    clip.source.clear();
    save_clip(clip, folder_ / (id + ".npz"));
    return folder_ / (id + ".npz");
  }
  test::ScratchFolder folder_;
};

TEST_F(GivenClips, ASuiteThatLacksThemSaysHowTheyAreGiven) {
  const Suite suite = suite_of("{files: given, pad: {before: 1}}");
  EXPECT_TRUE(suite.clips.given);
  EXPECT_THAT(resolved_yaml(suite), HasSubstr("clips: {files: given, pad: {before: 1, after: 0}}\n"));
  EXPECT_EQ(resolved_yaml(parse_suite(resolved_yaml(suite), "again.yaml")), resolved_yaml(suite));
  Progress quiet(Progress::Style::kQuiet);
  EXPECT_THAT(test::thrown_message<InputError>([&] { run_suite(suite, folder_ / "run", {}, quiet); }),
              AllOf(HasSubstr("g.yaml: its clips are not part of duet: expected --clips PATH"),
                    HasSubstr("-s 'clips.files=[PATH]', found none")));
  EXPECT_FALSE(fs::exists(folder_ / "run"));
}

TEST_F(GivenClips, AnOverrideGivesThem) {
  const std::string file = recording("one");
  const Suite suite = suite_of("{files: given}", {{"clips.files", "[" + file + "]"}});
  EXPECT_FALSE(suite.clips.given);
  EXPECT_THAT(suite.clips.files, ElementsAre(file));
}

TEST_F(GivenClips, EachTaskHasAsManySyntheticOnesAsItHasFiles) {
  const std::string files = recording("one") + ", " + recording("two") + ", " + recording("three", Task::kBend);
  const Suite suite = suite_of("{files: [" + files + "], synth: {per_file: 1, seed: 5, like: people}}");
  EXPECT_THAT(ids_of(prepared(suite)),
              ElementsAre("one", "two", "people-wave-s5-0000", "people-wave-s5-0001", "three", "people-bend-s5-0000"));
}

// As recordings are: cropped to the act, seen by a depth camera where that is asked for, padded by the suite.
TEST_F(GivenClips, SyntheticOnesBesideThemAreCroppedAndPaddedAsTheyAre) {
  const std::string files = "{files: [" + recording("one") + "], synth: {per_file: 1, seed: 5, like: people";
  const PairedMotion cropped = prepared(suite_of(files + "}}")).at(1);
  const PairedMotion padded_twin = prepared(suite_of(files + "}, pad: {before: 1, after: 2}}")).at(1);
  EXPECT_EQ(padded_twin.frames(), cropped.frames() + 150);
  const PairedMotion alone =
      prepared(suite_of("{synth: {per_task: 1, seed: 5, like: people}}", {{"tasks", "[wave]"}})).at(0);
  EXPECT_EQ(alone.clip_id, cropped.clip_id);
  EXPECT_GT(alone.frames(), cropped.frames() + 200);  // 4 s before and 2 s after are in it
  const PairedMotion seen = prepared(suite_of(files + ", tracked: true}}")).at(1);
  EXPECT_EQ(seen.clip_id, cropped.clip_id + "-tracked");
  EXPECT_NE(seen.source_partner.joints, cropped.source_partner.joints);
}

TEST_F(GivenClips, WhatWasMadeUpOfAClipIsATag) {
  const std::string whole = recording("whole"), legless = recording("legless");
  InteractionClip clip = load_clip(legless);
  clip.source = {{"made_up.legs", "1"}, {"made_up.gaps", "0.2"}};
  save_clip(clip, legless);
  const std::vector<PairedMotion> clips = prepared(suite_of("{files: [" + whole + ", " + legless + "]}"));
  EXPECT_FALSE(clips[0].tags.contains(kMadeUpTag));
  EXPECT_EQ(clips[1].tags.at("clip.made_up"), "gaps+legs");
}

TEST_F(GivenClips, BothRolesAreTwoClips) {
  const std::string files = "{files: [" + recording("one") + "]";
  const std::vector<PairedMotion> both =
      prepared(suite_of(files + ", synth: {per_file: 1, seed: 5, like: people}, roles: both}"));
  EXPECT_THAT(ids_of(both), ElementsAre("one", "one-A", "people-wave-s5-0000", "people-wave-s5-0000-A"));
  EXPECT_EQ(both[0].source_partner.joints, both[1].source_reactor.joints);
  EXPECT_EQ(both[0].source_reactor.joints, both[1].source_partner.joints);
  for (const std::size_t i : {0, 1, 2, 3}) EXPECT_EQ(both[i].tags.at("clip.people"), i < 2 ? "recorded" : "synthetic");
  for (const std::size_t i : {0, 2}) {
    EXPECT_FALSE(both[i].tags.contains(kRecordingTag));
    EXPECT_EQ(both[i + 1].tags.at("clip.recording"), both[i].clip_id);
  }
  EXPECT_THAT(resolved_yaml(suite_of(files + "}")), Not(HasSubstr("roles")));
  EXPECT_NE(suite_hash(suite_of(files + ", roles: both}")), suite_hash(suite_of(files + "}")));
}

TEST_F(GivenClips, WhatIsMadeHasOneRole) {
  const auto robot = test::g1();
  save_paired_motion(test::paired(Task::kWave, *robot), folder_ / "paired.npz");
  const Suite suite = suite_of("{files: [" + (folder_ / "paired.npz") + "], roles: both}");
  EXPECT_THAT(test::thrown_message<InputError>([&] { prepared(suite); }),
              AllOf(HasSubstr("paired.npz"), HasSubstr("as only these have two roles")));
}

TEST_F(GivenClips, WrittenOutTheyReadBackToTheSame) {
  const std::string file = recording("one");
  const Suite suite = suite_of("{files: [" + file +
                               "], synth: {per_file: 2, seed: 5, like: people, tracked: true}, pad: {before: 4, after: "
                               "2}, roles: both}");
  EXPECT_THAT(resolved_yaml(suite), HasSubstr("  synth: {per_file: 2, seed: 5, like: people, tracked: true}\n"
                                              "  pad: {before: 4, after: 2}\n  roles: both\n"));
  EXPECT_EQ(resolved_yaml(parse_suite(resolved_yaml(suite), "again.yaml")), resolved_yaml(suite));
}

TEST_F(GivenClips, WhatCannotBeIsRefusedByItsLine) {
  EXPECT_THAT(refusal_of_clips("{synth: {per_task: 1, per_file: 1}}"),
              AllOf(HasSubstr("g.yaml:4"), HasSubstr("per_file: expected files")));
  EXPECT_THAT(refusal_of_clips("{synth: {per_file: 1}}"), HasSubstr("found neither"));
  EXPECT_THAT(refusal_of_clips("{files: given, synth: {per_task: 1}}"), HasSubstr("found both"));
  EXPECT_THAT(refusal_of_clips("{files: givn}"), HasSubstr("expected a list"));
  EXPECT_THAT(refusal_of_clips("{files: given, synth: {per_file: -1}}"),
              HasSubstr("'per_file': expected a whole number"));
  EXPECT_THAT(refusal_of_clips("{files: given, roles: all}"), HasSubstr("'all'"));
  EXPECT_THAT(refusal_of_clips("{files: given, synth: {per_file: 1, tracked: 3}}"), HasSubstr("'tracked': expected"));
  EXPECT_THAT(refusal_of_clips("{files: given, synth: {variants: [{name: a, side: left}]}}"),
              HasSubstr("variants: expected per_task"));
}

// People stand beside robots in one folder, under the same ids.
TEST_F(GivenClips, OfADataSetAreItsPeople) {
  const std::string data = folder_ / "data";
  for (const char* part : {"people", "g1"}) {
    fs::create_directories(data + "/" + part);
    write_file(data + "/" + part + "/one.npz", part);
  }
  EXPECT_THAT(find_clip_files({data + "/people", data + "/g1"}),
              ElementsAre(data + "/people/one.npz", data + "/g1/one.npz"));
  write_file(data + "/dataset.json", "{}");
  EXPECT_THAT(find_clip_files({data}), ElementsAre(data + "/people/one.npz"));
  EXPECT_THAT(suite_of("{files: [" + data + "]}").clips.files, ElementsAre(data + "/people/one.npz"));
  fs::remove_all(data + "/people");
  EXPECT_THAT(
      test::thrown_message<InputError>([&] { find_clip_files({data}); }),
      AllOf(HasSubstr("is a data set in which no recording was kept"), HasSubstr("refused.csv"), HasSubstr("--gates")));
}

TEST_F(GivenClips, OneCommandPrintsRecordedBesideSynthetic) {
  const std::string suite = folder_ / "g.yaml";
  write_file(
      suite,
      yaml_with(
          "{files: given, synth: {per_file: 1, seed: 5, like: people}, pad: {before: 1, after: 1}, roles: both}"));
  const test::Answer without = test::duet_program("run " + suite + " -o " + (folder_ / "run"));
  EXPECT_EQ(without.code, 2);
  EXPECT_THAT(without.err, HasSubstr("expected --clips PATH"));
  const test::Answer answer =
      test::duet_program("run --tables " + suite + " --clips " + recording("one") + " -o " + (folder_ / "run"));
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, AllOf(HasSubstr("### Recorded and synthetic people"), HasSubstr("| replay ")));
  const test::Answer report = test::duet_program("report " + (folder_ / "run") + " -f md,csv,json,tex,html");
  ASSERT_EQ(report.code, 0) << report.err;
  for (const char* file : {"people.md", "people.csv", "people.json", "people.tex", "report.html"})
    EXPECT_TRUE(fs::exists((folder_ / "run/") + file)) << file;
  EXPECT_EQ(test::duet_program("verify " + (folder_ / "run")).code, 0);
  fs::remove(recording("one"));
  for (const fs::directory_entry& kept : fs::directory_iterator(folder_ / "run/inputs/clips")) fs::remove(kept.path());
  const test::Answer later = test::duet_program("report " + (folder_ / "run") + " -f html");
  ASSERT_EQ(later.code, 0) << later.err;
  EXPECT_THAT(read_file(folder_ / "run/report.html"),
              HasSubstr("Key frames and loss curves of the clips are left out:"));
}

// Other suites lose their synthesis to clips that are given, and keep nothing of it.
TEST_F(GivenClips, TakeThePlaceOfClipsPerTask) {
  const std::string suite = folder_ / "g.yaml";
  write_file(suite, yaml_with("{synth: {per_task: 1}}"));
  const test::Answer answer = test::duet_program("run " + suite + " --dry-run --clips " + recording("one"));
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, AllOf(HasSubstr("one.npz"), Not(HasSubstr("synth:"))));
}

}  // namespace
}  // namespace duet
