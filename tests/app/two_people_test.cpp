// Two people ran one suite: one report, one merged run, and where they disagree. Runs the built `duet`.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "duet/core/file.h"
#include "tests/app/program.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::Answer;
using test::duet_program;
using ::testing::HasSubstr;

// Two people run one suite, each with a policy of their own.
class TwoPeople : public testing::Test {
 protected:
  void SetUp() override {
    write_file(folder_ / "suite.yaml",
               "schema: duet.suite/1\nname: two\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
               "engines: [playback]\ncontrollers: [pd]\npolicies: [replay]\nstart: clip\n");
    const std::string run = "run -q " + (folder_ / "suite.yaml") + " -s policies=";
    ASSERT_EQ(duet_program(run + "[replay] -o " + mine_).code, 0);
    ASSERT_EQ(duet_program(run + "[replay_dense] -o " + yours_).code, 0);
  }
  // Changes a word of the null arm's row and nothing else.
  void change_null_row(const std::string& from, const std::string& to) {
    std::string text = read_file(yours_ + "/episodes.jsonl");
    const std::size_t row = text.find("\"arm\":\"null\"");
    const std::size_t at = text.find(from, row);
    ASSERT_NE(at, std::string::npos);
    write_file(yours_ + "/episodes.jsonl", text.replace(at, from.size(), to));
  }

  test::ScratchFolder folder_;
  std::string mine_ = folder_ / "mine", yours_ = folder_ / "yours", ours_ = folder_ / "ours";
};

TEST_F(TwoPeople, StandInOneReport) {
  const Answer report = duet_program("report -q --no-clips " + mine_ + " " + yours_ + " -o " + (folder_ / "report"));
  EXPECT_EQ(report.code, 0) << report.err;
  EXPECT_THAT(report.out, testing::AllOf(HasSubstr("replay_dense"), HasSubstr("| replay ")));
}

TEST_F(TwoPeople, MergeIntoOneRunThatIsVerifiedAndResumed) {
  const Answer merge = duet_program("merge " + mine_ + " " + yours_ + " -o " + ours_);
  ASSERT_EQ(merge.code, 0) << merge.err;
  EXPECT_THAT(merge.out, HasSubstr("3 episodes of 2 runs; 1 that more than one had are equal and there once"));
  const Answer verify = duet_program("verify -q --all " + ours_);
  EXPECT_EQ(verify.code, 0) << verify.out << verify.err;
  EXPECT_THAT(verify.out, HasSubstr("3 of 3 episodes repeat bit for bit"));
  const Answer resumed =
      duet_program("run -q --json " + (folder_ / "suite.yaml") + " -s policies=[replay,replay_dense] -o " + ours_);
  EXPECT_EQ(nlohmann::json::parse(resumed.out).at("already_there"), 3) << resumed.err;
  const Answer again = duet_program("merge " + mine_ + " " + yours_ + " -o " + ours_);
  EXPECT_EQ(again.code, 2);
  EXPECT_THAT(again.err, HasSubstr("is there already"));
}

TEST_F(TwoPeople, MergeInAnyOrderAndGroupingIsTheSameRows) {
  const std::string other = folder_ / "other", twice = folder_ / "twice";
  ASSERT_EQ(duet_program("merge -q " + mine_ + " " + yours_ + " -o " + ours_).code, 0);
  ASSERT_EQ(duet_program("merge -q " + yours_ + " " + mine_ + " -o " + other).code, 0);
  ASSERT_EQ(duet_program("merge -q " + ours_ + " " + other + " " + mine_ + " -o " + twice).code, 0);
  EXPECT_EQ(read_file(ours_ + "/episodes.jsonl"), read_file(other + "/episodes.jsonl"));
  EXPECT_EQ(read_file(ours_ + "/episodes.jsonl"), read_file(twice + "/episodes.jsonl"));
}

TEST_F(TwoPeople, WhoDisagreeOnTheNullArmAreNotMerged) {
  change_null_row("\"fell\":false", "\"fell\":true");
  const Answer merge = duet_program("merge " + mine_ + " " + yours_ + " -o " + ours_);
  EXPECT_EQ(merge.code, 1);
  EXPECT_THAT(merge.out,
              testing::AllOf(HasSubstr("is not the same in '" + mine_ + "' and '" + yours_ + "': fell: false, true"),
                             HasSubstr("nothing was written")));
  EXPECT_FALSE(std::filesystem::exists(ours_));
  EXPECT_EQ(duet_program("report -q " + mine_ + " " + yours_ + " -o " + ours_).code, 2);
  const Answer verify = duet_program("verify -q --all " + yours_);
  EXPECT_EQ(verify.code, 5);
  EXPECT_THAT(verify.out, HasSubstr("stored, now: fell: true, false"));
}

TEST_F(TwoPeople, CheckExactlyFindsOneChangedField) {
  const std::string other = folder_ / "again";
  ASSERT_EQ(duet_program("run -q " + (folder_ / "suite.yaml") + " -s policies=[replay_dense] -o " + other).code, 0);
  EXPECT_EQ(duet_program("check -q --exact " + other + " -b " + yours_).code, 0);
  change_null_row("\"fell\":false", "\"fell\":true");
  const Answer check = duet_program("check -q --exact " + other + " -b " + yours_);
  EXPECT_EQ(check.code, 1);
  EXPECT_THAT(check.out, HasSubstr("expected, found: fell: true, false"));
}

}  // namespace
}  // namespace duet
