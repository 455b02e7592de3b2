#include <gmock/gmock.h>

#include <filesystem>

#include "duet/archives/recording_file.h"
#include "duet/core/require.h"
#include "duet/execution/runner.h"
#include "duet/experiment/suite/profile.h"
#include "duet/metrics/catalogue.h"
#include "duet/rollout/world.h"
#include "duet/rows/row_file.h"
#include "duet/scoring/scoring.h"
#include "tests/execution/staged.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::IsEmpty;

Suite recording_suite(const std::string& engine, const std::string& more = "") {
  return parse_suite(
      "schema: duet.suite/1\nname: kept\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\n"
      "tasks: [handshake]\nengines: [" +
          engine +
          "]\ncontrollers: [vmc]\npolicies: [replay]\n"
          "record: {trajectories: all}\n" +
          more,
      "kept.yaml");
}

struct Kept {
  EpisodeRow row;
  std::string file;
};

// Runs one episode of the suite and keeps it.
Kept run_and_keep(const Suite& suite, const PairedMotion& clip, const std::string& folder) {
  const auto experiment = test::experiment_of(suite, {clip});
  Kept kept{experiment->run(test::first_of(*experiment, 3), {.trajectories = folder}), ""};
  for (const auto& entry : std::filesystem::directory_iterator(folder)) kept.file = entry.path().string();
  return kept;
}

PairedMotion short_clip(const RobotModel& robot) {
  SynthesisOptions options;
  options.duration = 12.0;
  return retarget(synthesize(Task::kHandshake, options), robot);
}

std::vector<std::string> different(const Kept& kept) {
  const EpisodeRecording episode = read_episode_recording(Npz::load(kept.file));
  return differing_fields(kept.row, score_again(episode.recording, episode.kept.value(), *test::g1()));
}

TEST(EpisodeRecording, ScoringAgainGivesTheSameRowToTheBit) {
  const PairedMotion clip = short_clip(*test::g1());
  for (const std::string engine : {"playback", "mujoco", "bullet"}) {
    if (!can_run_in(engine)) continue;
    const test::ScratchFolder folder;
    const Kept kept = run_and_keep(recording_suite(engine), clip, folder / engine);
    ASSERT_NE(kept.row.outcome, Outcome::kError) << kept.row.message;
    EXPECT_EQ(kept.row.verdicts.size(), 4u);
    EXPECT_GT(kept.row.metrics.size(), 20u);
    EXPECT_THAT(different(kept), IsEmpty()) << engine;
    for (const auto& [name, value] : kept.row.metrics) EXPECT_EQ(metric_info(name).name, name);
  }
}

// Values measured at the physics' rate are in the row that is kept; the partner is another than the clip's.
TEST(EpisodeRecording, SoAreEpisodesWithASolidAndAPerturbedPartner) {
  if (!is_available("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const PairedMotion clip = short_clip(*test::g1());
  const test::ScratchFolder folder;
  const Suite suite = recording_suite("mujoco",
                                      "partner: solid\ndetector: {version: paper, thresholds: strict}\n"
                                      "readings: {handshake.distance: agent_roots, metrics.jerk_scheme: central}\n"
                                      "perturbations: [{name: late, partner: {shift_s: 0.5}, mass: {add: 2}}]\n");
  const Kept kept = run_and_keep(suite, clip, folder / "solid");
  ASSERT_TRUE(kept.row.metrics.contains("contact_peak_force")) << kept.row.message;
  EXPECT_THAT(different(kept), IsEmpty());
}

TEST(EpisodeRecording, ARecordingOfSomebodyElseIsReadWithoutARow) {
  const test::ScratchFolder folder;
  const auto robot = test::g1();
  const PairedMotion clip = short_clip(*robot);
  save_recording(play_back(clip.robot, clip.partner.joints, clip.task, clip.phases, robot), folder / "plain.npz");
  const EpisodeRecording episode = read_episode_recording(Npz::load(folder / "plain.npz"));
  EXPECT_FALSE(episode.kept.has_value());
  EXPECT_EQ(episode.recording.frames(), clip.frames());
}

TEST(EpisodeRecording, BrokenOnesAreRefusedByKey) {
  const test::ScratchFolder folder;
  const Kept kept = run_and_keep(recording_suite("playback"), short_clip(*test::g1()), folder / "run");
  const auto refused = [&](const auto& edit) {
    Npz npz = Npz::load(kept.file);
    edit(npz);
    return thrown_message<InputError>([&] { (void)read_episode_recording(npz); });
  };
  EXPECT_SENTENCE(refused([](Npz& npz) { npz.set_text("row", "{]"); }));
  EXPECT_SENTENCE(refused([](Npz& npz) { npz.set_text("row", "{}"); }));
  EXPECT_SENTENCE(refused([](Npz& npz) { npz.set_text("detector_version", "dog"); }));
  EXPECT_SENTENCE(refused([](Npz& npz) { npz.set("act_partner", PointTracks(3, 24)); }));
  EXPECT_SENTENCE(refused([](Npz& npz) {
    npz.set("readings_names", std::vector<std::string>{"hug.singel"});
    npz.set("readings_values", std::vector<std::string>{"off"});
  }));
}

TEST(EpisodeRecording, AnotherRobotIsRefused) {
  const test::ScratchFolder folder;
  const Kept kept = run_and_keep(recording_suite("playback"), short_clip(*test::g1()), folder / "run");
  const EpisodeRecording episode = read_episode_recording(Npz::load(kept.file));
  RobotModel other = *test::g1();
  other.digest = "0123456789";
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)score_again(episode.recording, *episode.kept, other); }));
}

}  // namespace
}  // namespace duet
