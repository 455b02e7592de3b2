#include "duet/datasets/dataset.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "duet/archives/npy/npz.h"
#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/datasets/dataset_card.h"
#include "duet/datasets/entry.h"
#include "duet/motion/paired_motion.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/datasets/recordings.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Dataset : public ::testing::Test {
 protected:
  Dataset() {
    test::write_recording(in("h1.npz"), synthesize(Task::kHandshake, {.seed = 1}), "shaking hands");
    test::write_recording(in("hug.npz"), synthesize(Task::kHug, {.seed = 2}), "hugging");
    test::write_recording(in("kick.npz"), synthesize(Task::kWave, {.seed = 3}), "kicking");
    test::write_recording(in("nolabel.npz"), synthesize(Task::kHandshake, {.seed = 4}), "");
    test::write_recording(in("wrong.npz"), synthesize(Task::kWave, {.seed = 5}),
                          "hugging");  // a label that is not true
  }

  std::string in(const std::string& name) const { return folder_ / ("in/" + name); }
  std::string out(const std::string& name = "out") const { return folder_ / name; }
  DatasetPlan plan(int threads = 2) const {
    return {.inputs = {folder_ / "in"},
            .robots = {{.name = "g1", .model = robot_}},
            .pair = test::quick_pair(),
            .threads = threads};
  }
  static std::map<std::string, DatasetEntry> by_clip(const std::string& folder) {
    std::map<std::string, DatasetEntry> entries;
    for (DatasetEntry& entry : read_dataset(folder)) entries.emplace(entry.clip, std::move(entry));
    return entries;
  }
  // Every file's digest, but of the log, whose order is that in which clips were finished.
  static std::map<std::string, std::string> digests(const std::string& folder) {
    std::map<std::string, std::string> result;
    for (const auto& item : fs::recursive_directory_iterator(folder))
      if (item.is_regular_file() && item.path().filename() != "entries.jsonl")
        result[fs::relative(item.path(), folder).string()] = sha256_file(item.path().string());
    return result;
  }

  test::ScratchFolder folder_;
  std::shared_ptr<const RobotModel> robot_ = load_shared_robot();
};

TEST_F(Dataset, EachRecordingIsKeptRejectedOrCountedWithItsReason) {
  const DatasetSummary summary = make_dataset(plan(), out());
  EXPECT_EQ(summary.clips, 5);
  EXPECT_EQ(summary.kept, 3);
  EXPECT_EQ(summary.rejected, 1);
  EXPECT_EQ(summary.other, 1);
  EXPECT_EQ(summary.failed, 0);
  const auto entries = by_clip(out());
  EXPECT_EQ(entries.at("h1").task, "handshake");
  EXPECT_EQ(entries.at("hug").task, "hug");
  EXPECT_EQ(entries.at("nolabel").task, "handshake");
  EXPECT_EQ(entries.at("nolabel").provenance.at("task"), "detected");
  EXPECT_SENTENCE(entries.at("kick").reasons);
  // Where nothing is done the proposed act is what it may be: other gates may refuse it, too.
  EXPECT_THAT(entries.at("wrong").gates, ::testing::Contains("interaction clarity"));
  EXPECT_TRUE(fs::exists(out() + "/" + rejected_file("wrong")));
  EXPECT_FALSE(fs::exists(out() + "/" + people_file("wrong")));
}

TEST_F(Dataset, ATaskForAllLeavesOutWhatIsLabelledOtherwise) {
  DatasetPlan handshakes = plan();
  handshakes.robots.clear();
  handshakes.people.task = Task::kHandshake;
  handshakes.curation.gates.clear();
  make_dataset(handshakes, out());
  const auto entries = by_clip(out());
  EXPECT_EQ(entries.at("h1").status, ClipStatus::kKept);
  EXPECT_EQ(entries.at("nolabel").status, ClipStatus::kKept);
  for (const char* other : {"kick", "hug", "wrong"}) EXPECT_EQ(entries.at(other).status, ClipStatus::kOther) << other;
  EXPECT_SENTENCE(entries.at("kick").reasons);
  EXPECT_EQ(entries.at("kick").label, "kicking");
  // By hand it is what somebody says it is.
  handshakes.annotations["kick"] = {.clip = "kick", .task = Task::kWave};
  make_dataset(handshakes, out("annotated"));
  EXPECT_EQ(by_clip(out("annotated")).at("kick").task, "wave");
}

TEST_F(Dataset, RecordingsOfOneUnknownLabelAreTheTaskThatIsTold) {
  for (const char* name : {"a.npz", "b.npz"})
    test::write_recording(folder_ / (std::string("alike/") + name), synthesize(Task::kHandshake, {.seed = 4}),
                          "greeting");
  DatasetPlan told = plan();
  told.inputs = {folder_ / "alike"};
  told.robots.clear();
  told.people.task = Task::kHandshake;
  make_dataset(told, out());
  const auto entries = by_clip(out());
  EXPECT_EQ(entries.at("a").status, ClipStatus::kKept);
  EXPECT_EQ(entries.at("a").label, "greeting");
  EXPECT_THAT(entries.at("a").evidence,
              ::testing::Contains(HasSubstr("task: handshake (as told; its label is 'greeting')")));
}

TEST_F(Dataset, UnknownLabelsStandInTheAnnotationsToBeMapped) {
  DatasetPlan people = plan();
  people.robots.clear();
  make_dataset(people, out());
  std::string text = read_file(out() + "/annotations.csv");
  ASSERT_THAT(text, HasSubstr("kick,,,,,label 'kicking'"));
  text.replace(text.find("kick,,"), 6, "kick,wave,");
  people.annotations = parse_annotations(text, "annotations.csv");
  make_dataset(people, out("mapped"));
  EXPECT_EQ(by_clip(out("mapped")).at("kick").task, "wave");
  EXPECT_EQ(by_clip(out("mapped")).at("kick").status, ClipStatus::kKept);
}

TEST_F(Dataset, ClipsOfDuetAreRecordings) {
  const InteractionClip clip = synthesize(Task::kHandshake, {.seed = 6});
  save_clip(clip, folder_ / "clips/own.npz");
  DatasetPlan own = plan();
  own.inputs = {folder_ / "clips"};
  make_dataset(own, out());
  const DatasetEntry entry = by_clip(out()).at("own");
  EXPECT_EQ(entry.status, ClipStatus::kKept);
  EXPECT_EQ(entry.format, "duet-clip");
  EXPECT_EQ(entry.task, "handshake");
  const InteractionClip kept = load_clip(out() + "/" + people_file("own"));
  EXPECT_EQ(kept.a.joints, clip.a.joints);
  EXPECT_EQ(kept.phases, clip.phases);
  EXPECT_EQ(kept.contacts, clip.contacts);
  EXPECT_TRUE(fs::exists(out() + "/" + robot_file("g1", "own")));
}

TEST_F(Dataset, WhatIsKeptHasPeopleRobotAndFigures) {
  make_dataset(plan(), out());
  const DatasetEntry entry = by_clip(out()).at("h1");
  const PairedMotion paired = load_paired_motion(out() + "/" + robot_file("g1", "h1"));
  EXPECT_EQ(paired.frames(), entry.frames);
  EXPECT_EQ(load_clip(out() + "/" + people_file("h1")).frames(), entry.frames);
  ASSERT_EQ(entry.outputs.size(), 2U);
  for (const NamedDigest& output : entry.outputs) EXPECT_EQ(sha256_file(out() + "/" + output.file), output.sha256);
  EXPECT_EQ(entry.sources.size(), 1U);
  EXPECT_EQ(entry.sources.front().file, "h1.npz");
  EXPECT_EQ(entry.sources.front().sha256, sha256_file(in("h1.npz")));
  EXPECT_GT(entry.metrics.at("g1").at("jpe"), 0.0);
  EXPECT_GT(entry.statistics.seconds, 1.0);
}

TEST_F(Dataset, NoFolderOfWhoMadeItStandsInIt) {
  write_file(in("broken.npz"), "PK");
  make_dataset(plan(), out());
  const std::string folder = fs::path(in("h1.npz")).parent_path().string();
  for (const auto& [file, digest] : digests(out()))
    EXPECT_EQ(read_file(out() + "/" + file).find(folder), std::string::npos) << file;
  EXPECT_SENTENCE(by_clip(out()).at("broken").reasons.front());
}

TEST_F(Dataset, TheSameBytesWhateverTheThreads) {
  make_dataset(plan(1), out("one"));
  make_dataset(plan(3), out("three"));
  EXPECT_EQ(digests(out("one")), digests(out("three")));
}

TEST_F(Dataset, WhatWasStoppedGoesOnAndEndsTheSame) {
  make_dataset(plan(1), out("whole"));
  int finished = 0;
  const DatasetEvents two = {.finished = [&](const DatasetEntry&, bool) { ++finished; },
                             .stop = [&] { return finished == 2; }};
  const DatasetSummary stopped = make_dataset(plan(1), out("parts"), two);
  EXPECT_TRUE(stopped.stopped);
  EXPECT_EQ(stopped.kept + stopped.rejected + stopped.other, 2);
  const DatasetSummary rest = make_dataset(plan(1), out("parts"));
  EXPECT_EQ(rest.from_before, 2);
  EXPECT_EQ(digests(out("whole")), digests(out("parts")));
}

TEST_F(Dataset, WhatWasKilledGoesOnAndEndsTheSame) {
  make_dataset(plan(1), out("whole"));
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    int finished = 0;
    const DatasetEvents killed = {.finished = [&](const DatasetEntry&, bool) {
      if (++finished == 2) kill(getpid(), SIGKILL);
    }};
    make_dataset(plan(1), out("killed"), killed);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  // As a kill in the middle of a line leaves the log.
  LineAppender(out("killed") + "/entries.jsonl");
  { std::ofstream(out("killed") + "/entries.jsonl", std::ios::app) << "{\"clip\": \"hal"; }
  EXPECT_EQ(make_dataset(plan(1), out("killed")).from_before, 2);
  EXPECT_EQ(digests(out("whole")), digests(out("killed")));
}

TEST_F(Dataset, AnOutputThatIsGoneOrChangedIsMadeAnew) {
  make_dataset(plan(1), out());
  const auto before = digests(out());
  fs::remove(out() + "/" + robot_file("g1", "h1"));
  write_file(out() + "/" + people_file("hug"), "something else");
  EXPECT_EQ(make_dataset(plan(1), out()).from_before, 3);
  EXPECT_EQ(digests(out()), before);
}

TEST_F(Dataset, ASourceThatChangedIsReadAnew) {
  make_dataset(plan(1), out());
  test::write_recording(in("h1.npz"), synthesize(Task::kHandshake, {.seed = 77}), "shaking hands");
  EXPECT_EQ(make_dataset(plan(1), out()).from_before, 4);
  EXPECT_EQ(by_clip(out()).at("h1").sources.front().sha256, sha256_file(in("h1.npz")));
}

TEST_F(Dataset, AnAnnotationDecidesPhasesAndMakesOnlyItsClipAnew) {
  make_dataset(plan(1), out());
  DatasetPlan annotated = plan(1);
  annotated.annotations["h1"] = {.clip = "h1", .act_begin = 2.0, .act_end = 3.0};
  EXPECT_EQ(make_dataset(annotated, out()).from_before, 4);
  const DatasetEntry entry = by_clip(out()).at("h1");
  EXPECT_DOUBLE_EQ(entry.act_begin, 2.0);
  EXPECT_DOUBLE_EQ(entry.act_end, 3.0);
  EXPECT_EQ(entry.provenance.at("phases"), "annotated");
  EXPECT_THAT(read_file(out() + "/annotations.csv"), HasSubstr("h1,handshake,B,2.00,3.00,annotated"));
  annotated.annotations["nobody"] = {.clip = "nobody"};
  EXPECT_THROW(make_dataset(annotated, out()), InputError);
}

TEST_F(Dataset, AnotherWayOfMakingItIsRefusedInTheSameFolder) {
  make_dataset(plan(1), out());
  DatasetPlan other = plan(1);
  other.pair.weights.con = 0.5;
  try {
    make_dataset(other, out());
    FAIL();
  } catch (const InputError& error) {
    EXPECT_SENTENCE(error.what());
  }
}

TEST_F(Dataset, AFolderOfOtherThingsIsLeftAlone) {
  write_file(out() + "/notes.txt", "mine");
  try {
    make_dataset(plan(1), out());
    FAIL();
  } catch (const InputError& error) {
    EXPECT_SENTENCE(error.what());
  }
  EXPECT_EQ(read_file(out() + "/notes.txt"), "mine");
}

TEST_F(Dataset, ABrokenRecordingIsListedAndTheOthersGoOn) {
  std::string bytes = read_file(in("h1.npz"));
  bytes.resize(bytes.size() / 2);
  write_file(in("h1.npz"), bytes);
  const DatasetSummary summary = make_dataset(plan(), out());
  EXPECT_EQ(summary.kept + summary.failed, 3);
  const DatasetEntry entry = by_clip(out()).at("h1");
  EXPECT_EQ(entry.status, ClipStatus::kFailed);
  EXPECT_SENTENCE(entry.reasons.front());
}

TEST_F(Dataset, WhatIsKeptIsPaddedAfterItWasJudged) {
  make_dataset(plan(1), out("plain"));
  DatasetPlan longer = plan(1);
  longer.pad_before = 4.0;
  longer.pad_after = 2.0;
  make_dataset(longer, out());
  const DatasetEntry plain = by_clip(out("plain")).at("h1"), entry = by_clip(out()).at("h1");
  EXPECT_EQ(entry.frames, plain.frames + 300);
  EXPECT_NEAR(entry.act_begin, plain.act_begin + 4.0, 1e-12);
  EXPECT_EQ(entry.criteria, plain.criteria);
  EXPECT_EQ(entry.provenance.at("padded_s"), "4 before, 2 after");
  EXPECT_EQ(load_paired_motion(out() + "/" + robot_file("g1", "h1")).frames(), entry.frames);
}

TEST_F(Dataset, RejectedClipsAreMadeWhereAskedFor) {
  DatasetPlan all = plan(1);
  all.keep_rejected = true;
  make_dataset(all, out());
  EXPECT_TRUE(fs::exists(out() + "/" + robot_file("g1", "wrong")));
  EXPECT_EQ(by_clip(out()).at("wrong").status, ClipStatus::kRejected);
}

TEST_F(Dataset, TheTablesAreWhatTheEntriesSay) {
  make_dataset(plan(), out());
  const std::vector<DatasetEntry> entries = read_dataset(out());
  const TextTable outcomes = outcome_table(entries);
  EXPECT_THAT(outcomes.rows.front(), ElementsAre("kept", "3", "60.0 %"));
  EXPECT_THAT(outcomes.rows[1], ElementsAre("rejected", "1", "20.0 %"));
  const TextTable tasks = task_table(entries);
  ASSERT_EQ(tasks.rows.size(), 3U);  // hug, handshake, total
  EXPECT_EQ(tasks.rows.back()[1], "3");
  int frames = 0;
  for (const DatasetEntry& entry : entries) frames += entry.status == ClipStatus::kKept ? entry.frames : 0;
  EXPECT_EQ(tasks.rows.back()[2], std::to_string(frames));
  EXPECT_EQ(refused_table(entries).rows.size(), 2U);
  EXPECT_EQ(curation_table(entries).rows.back()[2], "4");  // before; the kick was not read
  EXPECT_EQ(curation_table(entries).rows.back()[3], "3");
}

TEST_F(Dataset, TheCardNamesSourcesTablesAndCautions) {
  make_dataset(plan(), out());
  const std::string card = read_file(out() + "/card.md");
  for (const char* words : {"3 of 5 recordings", "robots: g1", "positions", "| handshake", "by interaction clarity",
                            "Phases were proposed for 3 clips", "manifest.json", "its label 'kicking'"})
    EXPECT_THAT(card, HasSubstr(words));
  const std::string html = read_file(out() + "/card.html");
  EXPECT_THAT(html, HasSubstr("<img src=\"rejected/wrong.svg\""));
  const auto manifest = nlohmann::json::parse(read_file(out() + "/manifest.json"));
  ASSERT_EQ(manifest.size(), 5U);
  EXPECT_EQ(manifest[0]["clip"], "h1");
}

// The key and the words are those of people/body_people.cpp.
TEST(DatasetCard, SaysHowManyClipsHaveAnEstimatedSharedFrame) {
  std::vector<DatasetEntry> entries = {{.clip = "a", .status = ClipStatus::kKept},
                                       {.clip = "b", .status = ClipStatus::kKept}};
  const char* const words = "In 1 clips the two people were recorded apart";
  EXPECT_EQ(dataset_card_markdown(entries, nlohmann::json::object()).find(words), std::string::npos);
  entries[1].provenance["provenance"] = "estimated shared frame";
  EXPECT_THAT(dataset_card_markdown(entries, nlohmann::json::object()), HasSubstr(words));
}

TEST_F(Dataset, WhatWasMadeUpIsInEntryManifestAndCard) {
  DatasetPlan people = plan();
  people.robots.clear();
  people.curation.gates.clear();
  make_dataset(people, out("whole"));
  EXPECT_THAT(read_file(out("whole") + "/manifest.json"), ::testing::Not(HasSubstr("made_up")));
  EXPECT_THAT(read_file(out("whole") + "/card.md"), ::testing::Not(HasSubstr("Made up")));
  EXPECT_FALSE(fs::exists(out("whole") + "/tables/made_up.csv"));

  std::string csv = "time,head_x,head_y,head_z";
  const std::vector<std::pair<std::string, SmplJoint>> joints = {{"neck", kNeck},
                                                                 {"left_shoulder", kLeftShoulder},
                                                                 {"right_shoulder", kRightShoulder},
                                                                 {"left_elbow", kLeftElbow},
                                                                 {"right_elbow", kRightElbow},
                                                                 {"left_hand", kLeftHand},
                                                                 {"right_hand", kRightHand}};
  for (const auto& [name, joint] : joints) csv += fmt::format(",{0}_x,{0}_y,{0}_z", name);
  const InteractionClip wave = synthesize(Task::kWave, {.seed = 3});
  for (int t = 0; t < wave.frames(); t += 7) {
    const auto put = [&](SmplJoint joint) {
      const Eigen::Vector3d p = wave.a.joints.at(t, joint);
      csv += fmt::format(",{:.4f},{:.4f},{:.4f}", p.x(), p.y(), p.z());
    };
    csv += fmt::format("\n{:.4f}", t / 50.0);
    put(kHead);
    for (const auto& [name, joint] : joints) put(joint);
  }
  write_file(folder_ / "alone/w1.csv", csv);
  write_file(folder_ / "alone/w2.csv", csv);
  people.inputs = {folder_ / "alone"};
  people.people.still_partner = true;
  people.people.task = Task::kWave;
  people.people.fill_gaps = 0.5;
  make_dataset(people, out());
  const DatasetEntry entry = by_clip(out()).at("w1");
  EXPECT_EQ(entry.status, ClipStatus::kKept) << ::testing::PrintToString(entry.reasons);
  EXPECT_THAT(entry.made_up, ElementsAre(::testing::Pair("legs", 1.0), ::testing::Pair("partner", 1.0),
                                         ::testing::Pair("rate", ::testing::DoubleNear(0.857, 1e-3))));
  EXPECT_EQ(entry.reactor, "A");
  EXPECT_FALSE(entry.provenance.contains("made_up.legs"));
  EXPECT_EQ(parse_entry(entry_line(entry), "entry").made_up, entry.made_up);
  const auto manifest = nlohmann::json::parse(read_file(out() + "/manifest.json"));
  EXPECT_EQ(manifest[0]["made_up"]["legs"], 1.0);
  EXPECT_THAT(made_up_table(read_dataset(out())).rows, ElementsAre(ElementsAre("legs", "2", "100.0 %", "100.0 %"),
                                                                   ElementsAre("partner", "2", "100.0 %", "100.0 %"),
                                                                   ElementsAre("rate", "2", "100.0 %", "85.7 %")));
  EXPECT_THAT(read_file(out() + "/card.md"), HasSubstr("## Made up"));
  EXPECT_TRUE(fs::exists(out() + "/tables/made_up.csv"));
}

TEST_F(Dataset, PeopleAloneNeedNoRobot) {
  DatasetPlan people = plan();
  people.robots.clear();
  make_dataset(people, out());
  EXPECT_TRUE(fs::exists(out() + "/" + people_file("h1")));
  EXPECT_FALSE(fs::exists(out() + "/g1"));
}

}  // namespace
}  // namespace duet
