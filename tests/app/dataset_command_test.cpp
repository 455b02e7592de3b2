// `duet dataset` as a user types it.
#include <gmock/gmock.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "duet/archives/npy/npz.h"
#include "duet/core/recording.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/app/program.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using test::Answer;
using test::duet_program;
using ::testing::HasSubstr;

const std::string kStandIns = std::string(DUET_SOURCE_DIR) + "/examples/data";

class DatasetCommand : public ::testing::Test {
 protected:
  test::ScratchFolder folder_;
  std::string out_ = folder_ / "data";
};

TEST_F(DatasetCommand, TwoFilesAreADataSetWithoutAnyOption) {
  std::vector<std::string> files;
  for (const auto& item : fs::directory_iterator(kStandIns + "/bvh_cmu"))
    if (item.path().extension() == ".bvh") files.push_back(item.path().string());
  std::ranges::sort(files);
  ASSERT_EQ(files.size(), 2U);
  const Answer answer =
      duet_program("dataset retarget " + files[0] + " " + files[1] + " -o " + out_ + " --task handshake --no-curation");
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("1 clips of format 'bvh'"));
  for (const char* file : {"card.md", "card.html", "manifest.json", "annotations.csv", "tables/tasks.csv"})
    EXPECT_TRUE(fs::exists(out_ + "/" + file)) << file;
}

TEST_F(DatasetCommand, RecordingsBecomeAllRobotsAndGoOn) {
  const std::string command =
      "dataset retarget " + kStandIns + "/kinect --card g1,t1 --no-curation --option mode=grounded -o " + out_;
  EXPECT_EQ(duet_program(command).code, 0);
  EXPECT_FALSE(fs::is_empty(out_ + "/g1"));
  EXPECT_FALSE(fs::is_empty(out_ + "/t1"));
  const Answer again = duet_program(command + " --json");
  EXPECT_EQ(nlohmann::json::parse(again.out)["from_before"], nlohmann::json::parse(again.out)["clips"]);
  const Answer other = duet_program(command + " --option w-con=3");
  EXPECT_EQ(other.code, 2);
  EXPECT_THAT(other.err, HasSubstr("is a data set that was made otherwise"));
  const Answer stats = duet_program("dataset stats " + out_);
  EXPECT_THAT(stats.out, HasSubstr("sole_height"));
  const Answer converted = duet_program("dataset convert " + out_ + " --to gmr -o " + (folder_ / "gmr"));
  EXPECT_EQ(converted.code, 0) << converted.err;
  EXPECT_THAT(converted.out, HasSubstr("motions in format 'gmr'"));
  EXPECT_THAT(converted.err, testing::Not(HasSubstr("objects")));  // nobody carried one
}

// Most recordings of SBU are so.
TEST_F(DatasetCommand, RecordingsThatAreCroppedToTheActAreToldHowTheyAreKept) {
  SynthesisOptions options;
  options.like = Likeness::kPeople;
  options.outcome = ActOutcome::kComplete;
  for (options.index = 0; options.index < 4; ++options.index) {
    const InteractionClip clip = synthesize(Task::kHandshake, options);
    Npz npz;
    npz.set("a", clip.a.joints);
    npz.set("b", clip.b.joints);
    npz.set("joints", std::vector<std::string>(kSmplNames.begin(), kSmplNames.end()));
    npz.set_number("rate_hz", clip.rate_hz());
    npz.set_text("label", "handshake");
    npz.save(folder_ / ("cropped-" + std::to_string(options.index) + ".npz"));
  }
  const std::string files = "dataset curate " + (folder_ / "") + "cropped-*.npz -o " + out_;
  const Answer all = duet_program(files);
  EXPECT_EQ(all.code, 0) << all.err;
  EXPECT_THAT(all.out, testing::AllOf(HasSubstr("refused for the time before or after the act alone"),
                                      HasSubstr("suites/real.yaml adds the time")));
  const Answer three = duet_program(files + "-three --gates motion-fidelity,interaction-clarity,kinematic-feasibility");
  EXPECT_THAT(three.out, testing::Not(HasSubstr("before or after the act alone")));
  EXPECT_THAT(three.out, HasSubstr("| rejected                   |     0 |"));
}

TEST_F(DatasetCommand, AClipThatCannotBeReadIsListedAndSeenInTheExitCode) {
  fs::create_directories(folder_ / "in");
  fs::copy(kStandIns + "/kinect", folder_ / "in");
  write_file(folder_ / "in/broken.npz", "PK");
  const std::string command = "dataset curate " + (folder_ / "in") + " --no-curation -o " + out_;
  const Answer answer = duet_program(command);
  EXPECT_EQ(answer.code, 3) << answer.err;
  EXPECT_THAT(answer.out, testing::AllOf(HasSubstr("broken: "), HasSubstr("| kept                       |     1 |"),
                                         HasSubstr("| failed                     |     1 |")));
  fs::remove(folder_ / "in/broken.npz");
  EXPECT_EQ(duet_program(command + "-whole").code, 0);
}

TEST_F(DatasetCommand, InspectSaysWhatIsFoundAndWritesNothing) {
  const Answer answer = duet_program("dataset inspect " + kStandIns + "/kinect", "cd " + (folder_ / "") + ";");
  EXPECT_EQ(answer.code, 0) << answer.err;
  for (const char* words : {"format: positions", "clips: ", "skeleton: kinect-15", "up axis:"})
    EXPECT_THAT(answer.out, HasSubstr(words));
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(DatasetCommand, PhasesPrintsTheErrorOfProposals) {
  const Answer answer = duet_program("dataset phases --count 1");
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("| handshake |"));
}

TEST_F(DatasetCommand, WrongWordsAreRefusedInASentence) {
  const std::string inputs = kStandIns + "/kinect -o " + out_;
  const auto refusal = [&](const std::string& arguments) {
    const Answer answer = duet_program("dataset retarget " + arguments);
    EXPECT_EQ(answer.code, 2) << arguments;
    return answer.err;
  };
  EXPECT_THAT(refusal(inputs + " --gates motion"), HasSubstr("--gates: expected motion-fidelity"));
  EXPECT_THAT(refusal(inputs + " --limit joint_sped=3"), HasSubstr("unknown curation criterion 'joint_sped'"));
  EXPECT_THAT(refusal(inputs + " --up q"), HasSubstr("--up: expected"));
  EXPECT_THAT(refusal(inputs + " --align near"), HasSubstr("--align: expected none, floor, contact"));
  EXPECT_THAT(refusal(inputs + " --mirror --no-mirror"), HasSubstr("exclude each other"));
  EXPECT_THAT(refusal(inputs + " --gates motion-fidelity --no-curation"), HasSubstr("exclude each other"));
  EXPECT_THAT(refusal(inputs + " --option mode=flying"), HasSubstr("flying"));
  EXPECT_THAT(refusal(folder_ / "none -o x"), HasSubstr("no such file or folder"));
  EXPECT_THAT(duet_program("dataset stats " + (folder_ / "")).err, HasSubstr("expected a data set of duet"));
  EXPECT_FALSE(fs::exists(out_ + "/manifest.json"));
}

}  // namespace
}  // namespace duet
