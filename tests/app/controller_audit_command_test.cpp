// The exit codes of `duet controller audit`: 0 where nothing is named, 1 where a slip is, 2 for what it cannot read, 4
// for what is not there.
#include <gmock/gmock.h>

#include <filesystem>

#include "tests/app/program.h"
#include "tests/backends/engine_names.h"

namespace duet {
namespace {

using test::Answer;
using test::duet_program;
using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kDescriptor = std::string(DUET_SOURCE_DIR) + "/controllers/descriptors/rl_gym.yaml";
constexpr const char* kNetwork = "models/unitree_rl_gym_g1_motion.pt";

// rl_gym's descriptor with `what`, which is there once, in other words.
std::string altered(const std::string& what, const std::string& instead) {
  std::string text = read_file(kDescriptor);
  const std::size_t at = text.find(what);
  if (at == std::string::npos || text.find(what, at + 1) != std::string::npos) return "";
  return text.replace(at, what.size(), instead);
}

class ControllerAuditCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
    if (test::shared_file(kNetwork).empty()) GTEST_SKIP() << "not run: models absent";
  }
  // The audit of a file `mine.yaml` of this text.
  [[nodiscard]] Answer audit(const std::string& text, const std::string& more = "") const {
    write_file(folder_ / "mine.yaml", text);
    const std::string models = std::filesystem::path(test::shared_file(kNetwork)).parent_path().string();
    return duet_program("controller audit mine.yaml " + more,
                        "cd " + (folder_ / "") + "; DUET_MODELS='" + models + "'");
  }

  test::ScratchFolder folder_;
};

TEST_F(ControllerAuditCommand, EndsWellWhereNothingIsNamed) {
  const Answer answer = audit(read_file(kDescriptor));
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, AllOf(HasSubstr("L2 ok  forward"), HasSubstr("Nothing is named"),
                                HasSubstr("explicit law holds up to         14 ms (left_knee_joint) with the card's "
                                          "armature, 8.2 ms (left_knee_joint) without"),
                                HasSubstr("mujoco at 2 ms, of the profile parity")));
}

TEST_F(ControllerAuditCommand, EndsWithOneWhereASlipIsNamed) {
  const std::string slip = altered("{channel: joint_velocity, scale: 0.05}", "{channel: joint_velocity}");
  ASSERT_NE(slip, "");
  const Answer answer = audit(slip);
  EXPECT_EQ(answer.code, 1) << answer.out << answer.err;
  EXPECT_THAT(answer.out, AllOf(HasSubstr("the network expects joint_velocity with a scale of 0.05 (it says 1)"),
                                HasSubstr("The contract is wrong")));
}

TEST_F(ControllerAuditCommand, EndsWithTwoForWhatItCannotRead) {
  const std::string sizes = altered("channel: joint_velocity", "channel: base_linear_velocity");
  ASSERT_NE(sizes, "");
  write_file(folder_ / "page.onnx", "<!doctype html>\n");
  write_file(folder_ / "pointer.onnx", "version https://git-lfs.github.com/spec/v1\n");
  write_file(folder_ / "table.csv", "a,b\n1\n");
  const std::string right = read_file(kDescriptor);
  for (const auto& [answer, sentence] :
       {std::pair(audit(sizes), "mine.yaml:"), std::pair(audit(sizes), "expected 47 numbers, found 38"),
        std::pair(audit("schema: nothing\n"), "mine.yaml:"),
        std::pair(audit(right, "--network page.onnx"), "'page.onnx': "),
        std::pair(audit(right, "--network pointer.onnx"), "this is a Git LFS pointer"),
        std::pair(audit(right, "--trace table.csv"), "'table.csv': line 2"),
        std::pair(audit(right, "--engine mujuco"), "did you mean 'mujoco'")}) {
    EXPECT_EQ(answer.code, 2) << sentence << answer.out;
    EXPECT_THAT(answer.err, HasSubstr(sentence));
    EXPECT_EQ(answer.out, "") << sentence;
  }
}

TEST(ControllerAudit, EndsWithFourForWhatIsNotThere) {
  const Answer network = duet_program("controller audit gmt", "DUET_SHARED= DUET_MODELS=");
  EXPECT_EQ(network.code, 4);
  EXPECT_THAT(network.err, HasSubstr("no network of the controller 'gmt'"));
  const Answer known = duet_program("controller audit homie", "DUET_SHARED= DUET_MODELS=");
  EXPECT_EQ(known.code, 4);
  EXPECT_THAT(known.err, HasSubstr("; SHA-256 afe6363c83c8b9ab8b1a2fed598fce7de35ff045eee1a95b336fd6720e3d3d49)"));
  const Answer descriptor = duet_program("controller audit gmtt");
  EXPECT_EQ(descriptor.code, 4);
  EXPECT_THAT(descriptor.err, HasSubstr("no IO descriptor"));
}

}  // namespace
}  // namespace duet
