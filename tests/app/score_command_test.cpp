// `duet score`, `duet import` and `duet retarget` on motions of others: what they say of them, and what they refuse.
#include <gmock/gmock.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "duet/archives/npy/npz.h"
#include "duet/motion/interaction_clip.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/app/program.h"

namespace duet {
namespace {

using test::Answer;
using test::duet_program;
using test::ScratchFolder;
using ::testing::HasSubstr;
using ::testing::Not;

// A synthetic clip's file, changed as NumPy would.
template <typename Edit>
void write_clip(const std::string& path, Edit&& edit, Task task = Task::kHandshake) {
  Npz npz = Npz::parse(clip_bytes(synthesize(task, {})), path);
  edit(npz);
  npz.save(path);
}

void without_phases(Npz& npz) {
  Npz bare;
  for (const std::string& key : npz.keys())
    if (key != "phases") bare.set(key, npz.array(key));
  npz = bare;
}

void in_millimetres(Npz& npz) {
  for (const char* key : {"a_joints", "b_joints"}) {
    PointTracks joints = npz.tracks(key, kSmplJoints);
    for (double& value : joints.data()) value *= 1000.0;
    npz.set(key, joints);
  }
}

// A run of one playback episode whose trajectories are kept.
void run_playback(const ScratchFolder& folder) {
  write_file(folder / "suite.yaml",
             "schema: duet.suite/1\nname: kept\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
             "engines: [playback]\ncontrollers: [pd]\npolicies: [replay]\nstart: clip\nrecord: {trajectories: all}\n");
  const Answer answer = duet_program("run -q " + (folder / "suite.yaml") + " -o " + (folder / "run"));
  ASSERT_EQ(answer.code, 0) << answer.err;
}

std::string a_trajectory(const ScratchFolder& folder) {
  return std::filesystem::directory_iterator(folder / "run/trajectories")->path().string();
}

TEST(ScoreCommand, TrajectoriesOfARunGiveTheSameRows) {
  const ScratchFolder folder;
  ASSERT_NO_FATAL_FAILURE(run_playback(folder));
  const Answer all = duet_program("score -q --json " + (folder / "run/trajectories"));
  ASSERT_EQ(all.code, 0) << all.err;
  const nlohmann::json recordings = nlohmann::json::parse(all.out)["recordings"];
  ASSERT_EQ(recordings.size(), 2u);  // the main arm and the null arm
  for (const nlohmann::json& recording : recordings)
    EXPECT_TRUE(recording["as_in_the_run"]) << recording["differences"];
  const Answer one = duet_program("score -q " + a_trajectory(folder));
  EXPECT_THAT(one.out, HasSubstr("the row is the one that the run wrote, bit for bit"));
  EXPECT_THAT(one.out, HasSubstr("playback/pd/"));
  EXPECT_THAT(one.out, HasSubstr("dof_jerk"));
}

TEST(ScoreCommand, ATrajectoryThatWasChangedIsNoticed) {
  const ScratchFolder folder;
  ASSERT_NO_FATAL_FAILURE(run_playback(folder));
  const std::string path = a_trajectory(folder);
  Npz npz = Npz::load(path);
  NpyArray q = npz.array("q");
  std::get<std::vector<double>>(q.values)[100] += 1e-9;
  npz.set("q", q);
  npz.save(path);
  const Answer answer = duet_program("score -q " + path);
  EXPECT_EQ(answer.code, 5);
  EXPECT_THAT(answer.out, HasSubstr("the row is NOT the one that the run wrote: "));
  const nlohmann::json json = nlohmann::json::parse(duet_program("score -q --json " + path).out);
  EXPECT_FALSE(json["recordings"][0]["as_in_the_run"]);
  EXPECT_THAT(json["recordings"][0]["differences"].get<std::vector<std::string>>(), ::testing::Contains("state_hash"));
}

TEST(ScoreCommand, ARunAndAReportSayWhatTheyNeedInPlaceOfARecording) {
  const ScratchFolder folder;
  ASSERT_NO_FATAL_FAILURE(run_playback(folder));
  const std::string path = a_trajectory(folder);
  const Answer run = duet_program("run -q " + (folder / "suite.yaml") + " --clips " + path + " -o " + (folder / "x"));
  EXPECT_EQ(run.code, 2);
  EXPECT_THAT(run.err, HasSubstr("expected a clip of two people or a paired motion (`duet synth`"));
  EXPECT_THAT(run.err, HasSubstr("found a recording of a robot, which `duet score` judges"));
  const Answer report = duet_program("report -q " + path);
  EXPECT_EQ(report.code, 2);
  EXPECT_THAT(report.err, HasSubstr("expected the folder of a run, found a file; `duet score` judges recordings"));
}

TEST(ScoreCommand, AnImportedRobotMotionIsJudgedAlone) {
  const std::string walk = test::shared_file("data/g1_motions/twist2/walk_001.pkl");
  if (walk.empty()) GTEST_SKIP() << "not run: shared data/g1_motions absent";
  const ScratchFolder folder;
  ASSERT_EQ(duet_program("import -q " + walk + " -o " + (folder / "w.npz")).code, 0);
  const Answer answer = duet_program("score -q " + (folder / "w.npz"));
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("no partner, so no detector"));
  EXPECT_THAT(answer.out, HasSubstr("hf_ratio"));
  EXPECT_THAT(answer.out, HasSubstr("jerk_mean"));
  EXPECT_THAT(answer.out, Not(HasSubstr("root_error"))) << "it is its own reference";
  EXPECT_THAT(answer.out, Not(HasSubstr("hug")));
}

TEST(ScoreCommand, ARobotOfOtherJointsIsRefusedWithTheCardToGive) {
  const ScratchFolder folder;
  ASSERT_NO_FATAL_FAILURE(run_playback(folder));
  const std::string path = a_trajectory(folder);
  const Answer other = duet_program("score -q " + path + " --card " + DUET_SOURCE_DIR + "/robots/g1/g1_27dof.yaml");
  EXPECT_EQ(other.code, 2);
  EXPECT_THAT(other.err, HasSubstr("expected the 27 joints of"));
  EXPECT_THAT(other.err, HasSubstr("--card"));
}

TEST(ScoreCommand, AllDetectorsShowValuesThresholdsAndMargins) {
  const ScratchFolder folder;
  write_clip(folder / "a.npz", [](Npz&) {});
  const Answer paper = duet_program("score -q " + (folder / "a.npz") + " --all-detectors");
  ASSERT_EQ(paper.code, 0) << paper.err;
  for (const char* text : {"people", "robot", "printed", "fly_kiss", "shoulder_distance_min", "margin of min_frames",
                           "shoulder_distance_both_min", "evidence_frames"})
    EXPECT_THAT(paper.out, HasSubstr(text));
  const Answer strict = duet_program("score -q --json " + (folder / "a.npz") + " --thresholds strict --all-detectors");
  const nlohmann::json json = nlohmann::json::parse(strict.out);
  EXPECT_EQ(json["thresholds"], "strict");
  const nlohmann::json& five = json["clips"][0]["detectors"]["high_five"]["people"];
  EXPECT_EQ(five["thresholds"]["contact"], 0.15);
  EXPECT_TRUE(five["values"].contains("distance_min"));
  EXPECT_TRUE(five["margins"].contains("max_sustained"));
  EXPECT_EQ(json["clips"][0]["detectors"].size(), all_tasks().size());
}

TEST(ScoreCommand, AllReadingsArePrintedWithTheirUnits) {
  const ScratchFolder folder;
  write_clip(folder / "a.npz", [](Npz&) {});
  const Answer answer = duet_program("score -q " + (folder / "a.npz") + " --all-readings");
  ASSERT_EQ(answer.code, 0) << answer.err;
  for (const char* name : {"awd.with_hands.full", "large_angle_ratio.grouped.entry", "jerk_mean.links.diff"})
    EXPECT_THAT(answer.out, HasSubstr(name));  // docs/deviations.md M13, M17, M18
  EXPECT_THAT(answer.out, HasSubstr("m/s^3"));
}

TEST(ScoreCommand, AClipWithoutPhasesIsTakenWithANote) {
  const ScratchFolder folder;
  write_clip(folder / "bare.npz", without_phases);
  for (const std::string& command :
       {"score " + (folder / "bare.npz"), "retarget " + (folder / "bare.npz") + " -o " + (folder / "paired.npz")}) {
    const Answer answer = duet_program(command);
    EXPECT_EQ(answer.code, 0) << answer.err;
    EXPECT_THAT(answer.err, HasSubstr("bare.npz': phases: act [")) << command;
    EXPECT_THAT(answer.err, HasSubstr("(proposed)")) << command;
  }
}

TEST(ScoreCommand, ImplausiblePeopleAreRefusedAtEveryDoorUnlessTakenAsTheyAre) {
  const ScratchFolder folder;
  write_clip(folder / "mm.npz", in_millimetres);
  write_file(folder / "suite.yaml",
             "schema: duet.suite/1\nname: mm\nversion: 1.0.0\nclips: {files: [mm.npz]}\nengines: [playback]\n"
             "controllers: [pd]\npolicies: [replay]\nstart: clip\n");
  const std::string clip = folder / "mm.npz";
  for (const std::string& command : {"score " + clip, "retarget " + clip + " -o " + (folder / "paired.npz"),
                                     "run " + (folder / "suite.yaml") + " -o " + (folder / "run")}) {
    const Answer answer = duet_program(command + " -q");
    EXPECT_EQ(answer.code, 2) << command;
    EXPECT_THAT(answer.err, HasSubstr("the unit may be the millimetre")) << command;
    EXPECT_EQ(std::count(answer.err.begin(), answer.err.end(), '\n'), 1) << answer.err;
  }
  const Answer taken = duet_program("retarget --as-is " + clip + " -o " + (folder / "paired.npz"));
  EXPECT_EQ(taken.code, 0) << taken.err;
  EXPECT_THAT(taken.err, HasSubstr("measures"));
}

TEST(ScoreCommand, ThreadsAreCountedFromOne) {
  for (const char* command : {"score x.npz -j 0", "score x.npz -j -3", "retarget x.npz -o y -j 0"})
    EXPECT_THAT(duet_program(command).err, HasSubstr("not in range 1 to 1024")) << command;
}

// Both persons replaced: two clips, two files, one run.
TEST(ScoreCommand, OneClipWithEitherPersonReplacedFitsIntoOneRun) {
  const ScratchFolder folder;
  write_clip(folder / "clips/shake.npz", [](Npz&) {});
  for (const char* who : {"A", "B"}) {
    const Answer made =
        duet_program("retarget -q " + (folder / "clips") + " --robot " + who + " -o " + (folder / "paired"));
    ASSERT_EQ(made.code, 0) << made.err;
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "paired/shake.npz"));
  EXPECT_TRUE(std::filesystem::exists(folder / "paired/shake-A.npz"));
  write_file(folder / "suite.yaml",
             "schema: duet.suite/1\nname: both\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\nengines: [playback]\n"
             "controllers: [pd]\npolicies: [replay]\nstart: clip\n");
  const Answer run = duet_program("run -q --json " + (folder / "suite.yaml") + " --clips " + (folder / "paired") +
                                  " -o " + (folder / "run"));
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(nlohmann::json::parse(run.out)["planned"], 4);
}

// Other retargeters know no reshaped person: everything but JPE is there.
TEST(ScoreCommand, APairedMotionWithoutAReshapedPersonHasNoJpe) {
  const ScratchFolder folder;
  write_clip(folder / "clip.npz", [](Npz&) {});
  ASSERT_EQ(duet_program("retarget -q " + (folder / "clip.npz") + " -o " + (folder / "paired.npz")).code, 0);
  const Npz whole = Npz::load(folder / "paired.npz");
  Npz bare;
  for (const std::string& key : whole.keys())
    if (key != "reshaped") bare.set(key, whole.array(key));
  bare.save(folder / "bare.npz");
  const Answer score = duet_program("score -q --json " + (folder / "bare.npz"));
  ASSERT_EQ(score.code, 0) << score.err;
  const nlohmann::json metrics = nlohmann::json::parse(score.out)["clips"][0]["metrics"];
  EXPECT_TRUE(metrics["jpe"].is_null());
  EXPECT_TRUE(metrics["awd"].is_number());
  write_file(folder / "suite.yaml",
             "schema: duet.suite/1\nname: bare\nversion: 1.0.0\nclips: {files: [bare.npz]}\nengines: [playback]\n"
             "controllers: [pd]\npolicies: [replay]\nstart: clip\n");
  const Answer run = duet_program("run -q " + (folder / "suite.yaml") + " -o " + (folder / "run"));
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(read_file(folder / "run/episodes.jsonl"), HasSubstr("\"awd\""));
  EXPECT_THAT(read_file(folder / "run/episodes.jsonl"), Not(HasSubstr("\"jpe\"")));
}

TEST(ScoreCommand, ReshapedPointsOfAnotherRobotAreRefusedBeforeTheRun) {
  const ScratchFolder folder;
  write_clip(folder / "clip.npz", [](Npz&) {});
  ASSERT_EQ(duet_program("retarget -q " + (folder / "clip.npz") + " -o " + (folder / "paired.npz")).code, 0);
  Npz npz = Npz::load(folder / "paired.npz");
  npz.set("reshaped", npz.tracks("reshaped", 16).select({0, 1, 2}));
  npz.save(folder / "paired.npz");
  write_file(folder / "suite.yaml",
             "schema: duet.suite/1\nname: three\nversion: 1.0.0\nclips: {files: [paired.npz]}\nengines: [playback]\n"
             "controllers: [pd]\npolicies: [replay]\nstart: clip\n");
  const Answer run = duet_program("run -q " + (folder / "suite.yaml") + " -o " + (folder / "run"));
  EXPECT_EQ(run.code, 2);
  EXPECT_THAT(run.err, HasSubstr("key 'reshaped': expected the 16 pairs of 'g1"));
  EXPECT_THAT(run.err, HasSubstr("found 3 points"));
}

TEST(ScoreCommand, ImportSaysThePhasesOnce) {
  const std::string folder_of_bvh = test::shared_file("data/cmu_handshake");
  if (folder_of_bvh.empty()) GTEST_SKIP() << "not run: shared data/cmu_handshake absent";
  const ScratchFolder folder;
  const Answer answer = duet_program("import -q " + folder_of_bvh + "/18_01.bvh " + folder_of_bvh +
                                     "/19_01.bvh --task handshake -o " + (folder / "h.npz"));
  ASSERT_EQ(answer.code, 0) << answer.err;
  const std::size_t first = answer.out.find("phases");
  EXPECT_EQ(answer.out.find("phases", first + 1), std::string::npos) << answer.out;
  EXPECT_THAT(answer.out, Not(HasSubstr("not as expected"))) << "these people are plausible";
}

TEST(ScoreCommand, ListDetectorsPrintsTableS11AndTheStrictSet) {
  const Answer answer = duet_program("list detectors");
  ASSERT_EQ(answer.code, 0) << answer.err;
  for (const char* text : {"min_frames 3 frames (strict 25): one way to embrace lasts so many frames on end",
                           "strict reads bend.direction=forward", "prints shoulder_distance_both_min [m]",
                           "act trunks 0.45m: the trunks are at most so far apart, level"})
    EXPECT_THAT(answer.out, HasSubstr(text));
  const nlohmann::json json = nlohmann::json::parse(duet_program("list detectors --json").out);
  EXPECT_EQ(json.size(), all_tasks().size());
  EXPECT_EQ(json[0]["thresholds"]["min_frames"]["strict"], 25);
  EXPECT_EQ(json[4]["strict_readings"]["bend.direction"], "forward");
}

}  // namespace
}  // namespace duet
