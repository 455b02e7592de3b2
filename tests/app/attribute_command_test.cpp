// `duet attribute` and `duet blame` as a user has them.
#include <gmock/gmock.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "duet/core/file.h"
#include "tests/app/program.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

using test::Answer;
using test::duet_program;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

// Two clips under a controller that falls within seconds.
std::string suite_file_in(const test::ScratchFolder& folder) {
  write_file(folder / "falls.yaml",
             "schema: duet.suite/1\nname: falls\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\n"
             "tasks: [wave, handshake]\nengines: [playback, bullet, mujoco]\ncontrollers: [pd]\npolicies: [replay]\n"
             "start: act\n");
  return folder / "falls.yaml";
}

class AttributeCommand : public testing::Test {
 protected:
  [[nodiscard]] Answer attribute(const std::string& more) const {
    return duet_program("attribute " + suite_ + " --engines bullet -q " + more);
  }
  test::ScratchFolder folder_;
  std::string suite_ = suite_file_in(folder_), out_ = folder_ / "why";
};

TEST_F(AttributeCommand, RefusesInOneSentenceBeforeAnyEpisode) {
  const auto refused = [&](const std::string& more) {
    const Answer answer = attribute(more + " -o " + out_);
    EXPECT_EQ(answer.code, 2) << more;
    EXPECT_EQ(answer.out, "") << more;
    EXPECT_THAT(answer.err, StartsWith("duet: ")) << more;
    EXPECT_FALSE(fs::exists(out_)) << more;
    return answer.err;
  };
  EXPECT_THAT(refused("--from parity --to parity"), HasSubstr("are the same"));
  EXPECT_THAT(refused("--to cone=pyramidal"), AllOf(HasSubstr("bullet"), HasSubstr("cone")));
  EXPECT_THAT(refused("--to dt=0.001,erp=0.5,iterations=5,stop_erp=0.1,engine=mujoco"), HasSubstr("5 switches"));
  EXPECT_THAT(refused("--to quick"), HasSubstr("'quick'"));
  EXPECT_THAT(refused("--to dt=0.001 --group dt"), HasSubstr("dt"));
  EXPECT_THAT(refused("--to dt=0.001 --policies dstar"), HasSubstr("no policy 'dstar'"));
  EXPECT_EQ(attribute("--to dt=0.001").code, 2);  // no folder
  EXPECT_EQ(duet_program("attribute " + suite_ + " --engines nowhere --to dt=0.001 -o " + out_).code, 2);
}

TEST_F(AttributeCommand, RunsEachCellOnceAndWritesTheFigures) {
  const std::string ask = "--to dt=0.004,iterations=5 --resamples 100 -o " + out_;
  const Answer first = attribute(ask + " --json");
  ASSERT_EQ(first.code, 0) << first.err;
  const nlohmann::json json = nlohmann::json::parse(first.out);
  EXPECT_EQ(json.at("switches"), nlohmann::json({"dt", "solver"}));
  EXPECT_EQ(json.at("cells"), nlohmann::json({"from", "dt", "solver", "to"}));
  EXPECT_EQ(json.at("episodes"), 8);
  for (const char* file : {"attribution.md", "attribution.csv", "attribution.json", "attribution.tex",
                           "attribution.svg", "cells/from/run.json", "cells/dt/episodes.jsonl"})
    EXPECT_TRUE(fs::exists(out_ + "/" + file)) << file;
  EXPECT_FALSE(fs::exists(out_ + "/prepared"));
  const std::string rows = read_file(out_ + "/cells/dt/episodes.jsonl");
  const Answer again = attribute(ask);
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(read_file(out_ + "/cells/dt/episodes.jsonl"), rows);
  EXPECT_THAT(again.out, AllOf(HasSubstr("dt: dt 0.002 -> 0.004"), HasSubstr("dt x solver"), HasSubstr("8 episodes")));
  EXPECT_EQ(duet_program("verify " + out_ + "/cells/to -q").code, 0);
  // Other switches are another folder's.
  EXPECT_EQ(attribute("--to dt=0.01,iterations=5 -o " + out_).code, 2);
}

TEST_F(AttributeCommand, StopsResumableAndGoesOn) {
  const std::string ask = "--to dt=0.004 --resamples 100 -o " + out_;
  EXPECT_EQ(attribute(ask + " --time-limit 0.05").code, 75);
  EXPECT_EQ(attribute(ask).code, 0);
}

class BlameCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new test::ScratchFolder();
    ASSERT_EQ(duet_program("run " + suite_file_in(*folder_) + " -q -o " + *folder_ / "run").code, 0);
  }
  static void TearDownTestSuite() { delete folder_; }
  static Answer blame(const std::string& more) {
    return duet_program("blame " + *folder_ / "run" + " " + more + " -q");
  }
  static test::ScratchFolder* folder_;
};
test::ScratchFolder* BlameCommand::folder_ = nullptr;

TEST_F(BlameCommand, NamesThePolicyOrControllerOfAFallInEveryEngine) {
  const Answer answer =
      blame("handshake --engine bullet --policy replay --restart-in mujoco --jitters 1 --before 0.5 --json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const nlohmann::json json = nlohmann::json::parse(answer.out);
  EXPECT_EQ(json.at("engine"), "bullet");
  EXPECT_EQ(json.at("culprit"), "policy");
  EXPECT_EQ(json.at("restarts").at(0).at("seconds"), 0.0);
  EXPECT_THAT(answer.err, Not(HasSubstr("other states")));
}

TEST_F(BlameCommand, RefusesInOneSentence) {
  const auto refused = [&](const std::string& more, int code = 2) {
    const Answer answer = blame(more);
    EXPECT_EQ(answer.code, code) << more;
    EXPECT_EQ(answer.out, "") << more;
    EXPECT_THAT(answer.err, StartsWith("duet: ")) << more;
    return answer.err;
  };
  EXPECT_THAT(refused("nothing"), HasSubstr("no episode in an engine begins with 'nothing'"));
  EXPECT_THAT(refused("handshake"), HasSubstr("failed episodes: expected one"));
  EXPECT_THAT(refused("handshake --engine playback"), HasSubstr("no episode in an engine"));
  EXPECT_THAT(refused("handshake --engine bullet --policy replay --restart-in nowhere", 4), HasSubstr("'nowhere'"));
  EXPECT_THAT(refused("handshake --engine bullet --policy replay --restart-in bullet"), HasSubstr("beside"));
  EXPECT_EQ(duet_program("blame " + *folder_ / "none" + " handshake").code, 2);
  fs::copy(*folder_ / "run", *folder_ / "bare", fs::copy_options::recursive);
  fs::remove(*folder_ / "bare/suite.yaml");
  const Answer bare = duet_program("blame " + *folder_ / "bare" + " handshake --engine bullet --policy replay");
  EXPECT_EQ(bare.code, 2);
  EXPECT_THAT(bare.err, HasSubstr("suite.yaml"));
}

}  // namespace
}  // namespace duet
