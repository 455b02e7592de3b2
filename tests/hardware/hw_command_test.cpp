// `duet hw` and `duet replay-log` as a user types them, with a twin as a second process.
#include <gmock/gmock.h>

#include <thread>

#include "duet/core/file.h"
#include "duet/hardware/wire/robot_wire.h"
#include "tests/app/program.h"

namespace duet {
namespace {

using test::Answer;
using test::duet_program;
using ::testing::HasSubstr;

// Other domains and ports than the tests of the wire have, by the process.
int own_domain() {
  return kFirstTwinDomain + (static_cast<int>(getpid()) + 50) % (kLastTwinDomain - kFirstTwinDomain + 1);
}
int own_port() { return 20000 + static_cast<int>(getpid()) % 20000; }

std::string config_of(const std::string& more = "twin: true\ninterface: lo\nallow_motion: true\nperson: false\n") {
  return "schema: duet.robot/1\nrobot: twin\nmode_machine: 5\ndomain: " + std::to_string(own_domain()) + "\n" + more;
}

std::string twin_command(const std::string& seconds) {
  return std::string(DUET_TWIN) + " --operated --seconds " + seconds + " --domain " + std::to_string(own_domain()) +
         " --velocity-port " + std::to_string(own_port()) + " >/dev/null 2>&1 & ";
}

TEST(HwCommand, SaysFirstThatNothingIsWrittenAndThenThatNobodyAnswers) {
  const test::ScratchFolder folder;
  write_file(folder / "twin.yaml", config_of());
  const Answer answer = duet_program("hw check --seconds 0.5 " + (folder / "twin.yaml"));
  EXPECT_EQ(answer.code, 4);
  EXPECT_THAT(answer.err, HasSubstr("Nothing is written to it: no writer is made."));
  EXPECT_THAT(answer.err, HasSubstr("no state of twin 'twin'"));
}

// The cost of a tick is measured while the guard runs, beside a twin with everything that running needs.
TEST(HwCommand, BenchTimesAGuardThatRuns) {
  const Answer answer = duet_program("bench hardware/tick/alone --seconds 0.01");
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("hardware/tick/alone:p99"));
}

TEST(HwCommand, RefusesAConfigurationThatIsWrong) {
  const test::ScratchFolder folder;
  write_file(folder / "bad.yaml", config_of("interface: auto\n"));
  const Answer answer = duet_program("hw check " + (folder / "bad.yaml"));
  EXPECT_EQ(answer.code, 2);
  EXPECT_THAT(answer.err, HasSubstr("expected the name of one (not 'auto')"));
}

// Everything is there but what only a person can give: the signature, and before it an executor of a robot.
TEST(HwCommand, ARobotIsNotArmedWithoutAnExecutorOdometryAndSignedLimits) {
  const test::ScratchFolder folder;
  const auto refusal = [&](const std::string& name, const std::string& more) {
    write_file(
        folder / (name + ".yaml"),
        "schema: duet.robot/1\nrobot: x\nmode_machine: 5\ndomain: 99\ninterface: lo\nallow_motion: true\n" + more);
    const Answer answer =
        duet_program("hw arm " + (folder / (name + ".yaml")) + " --log " + (folder / (name + ".mcap")));
    EXPECT_EQ(answer.code, 2) << answer.err;
    return answer.err;
  };
  EXPECT_THAT(refusal("twin", ""), HasSubstr("not armed: executor 'twin' is a twin's"));
  EXPECT_THAT(refusal("blind", "executor: homie-lcm\n"), HasSubstr("without measured odometry nothing walks"));
  EXPECT_THAT(refusal("vendor", "executor: homie-lcm\nodometry: vendor\n"),
              HasSubstr("only while the maker's own walking runs"));
  const std::string unsigned_limits = refusal("unsigned", "executor: sport\nodometry: vendor\n");
  EXPECT_THAT(unsigned_limits, HasSubstr("nobody has checked them against the standard"));
  EXPECT_THAT(unsigned_limits, HasSubstr("this is not HOMIE"));
}

TEST(HwCommand, AWrongWordArmsNothing) {
  const test::ScratchFolder folder;
  write_file(folder / "twin.yaml", config_of());
  const Answer answer = duet_program(
      "hw arm " + (folder / "twin.yaml") + " --velocity-port 15001 --log " + (folder / "run.mcap"), "echo wrong |");
  EXPECT_EQ(answer.code, 2);
  EXPECT_THAT(answer.err, HasSubstr("not armed: expected the word on the screen, found 'wrong'"));
  EXPECT_THAT(answer.err, HasSubstr("not safety-rated"));
}

TEST(HwCommand, RunAndStopSayThatNoGuardIsThere) {
  for (const char* command : {"run", "stop"}) {
    const Answer answer = duet_program(std::string("hw ") + command + " --socket /tmp/no-such-guard");
    EXPECT_EQ(answer.code, 2) << command;
    EXPECT_THAT(answer.err, HasSubstr("nobody receives at '/tmp/no-such-guard'")) << command;
  }
}

TEST(HwCommand, ADryRunOfATwinIsReadyAndItsLogIsTheSameAgain) {
  const test::ScratchFolder folder;
  write_file(folder / "twin.yaml", config_of());
  const Answer dry = duet_program("hw dry-run --json --seconds 4 --socket " + (folder / "guard") + " --log " +
                                      (folder / "run.mcap") + " " + (folder / "twin.yaml"),
                                  twin_command("7"));
  EXPECT_EQ(dry.code, 0) << dry.err;
  EXPECT_THAT(dry.out, HasSubstr("\"checksum_faults\": 0"));
  const Answer replay = duet_program("replay-log --json " + (folder / "run.mcap"));
  EXPECT_EQ(replay.code, 0) << replay.err;
  EXPECT_THAT(replay.out, HasSubstr("\"different\": 0"));
}

// A dry run tells its status, and leaves a log that a report is made of.
TEST(HwCommand, StatusAndReportOfADryRun) {
  const test::ScratchFolder folder;
  write_file(folder / "twin.yaml", config_of());
  const std::string dry = std::string(DUET_PROGRAM) + " hw dry-run --seconds 5 --socket " + (folder / "guard") +
                          " --log " + (folder / "run.mcap") + " " + (folder / "twin.yaml") + " >/dev/null 2>&1 & ";
  const Answer status =
      duet_program("hw status --json --socket " + (folder / "guard"), twin_command("8") + dry + "sleep 3; ");
  EXPECT_EQ(status.code, 0) << status.err;
  EXPECT_THAT(status.out, HasSubstr("\"state_age\""));
  EXPECT_THAT(status.out, HasSubstr("\"next\""));
  std::this_thread::sleep_for(std::chrono::seconds(4));  // the dry run's end
  const Answer report =
      duet_program("hw report " + (folder / "run.mcap") + " --format md,json -o " + (folder / "debriefing"));
  EXPECT_EQ(report.code, 0) << report.err;
  EXPECT_THAT(report.out, HasSubstr("the log is whole"));
  EXPECT_THAT(report.out, HasSubstr("| ready "));
  EXPECT_THAT(read_file(folder / "debriefing/log.json"), HasSubstr("\"duet.analysis/1\""));
  EXPECT_THAT(read_file(folder / "debriefing/log.md"), HasSubstr("States"));
}

TEST(HwCommand, StatusAndReportSayWhatIsMissing) {
  const test::ScratchFolder folder;
  const Answer status = duet_program("hw status --socket " + (folder / "nobody"));
  EXPECT_EQ(status.code, 4);
  EXPECT_THAT(status.err, HasSubstr("no guard tells its status at"));
  write_file(folder / "text", "text");
  const Answer report = duet_program("hw report " + (folder / "text"));
  EXPECT_EQ(report.code, 2);
  EXPECT_THAT(report.err, HasSubstr("expected an MCAP file"));
  const Answer format = duet_program("hw report " + (folder / "text") + " --format html");
  EXPECT_EQ(format.code, 2);
  EXPECT_THAT(format.err, HasSubstr("unknown format 'html'"));
}

TEST(HwCommand, ReplayRefusesWhatIsNoLog) {
  const test::ScratchFolder folder;
  write_file(folder / "text", "text");
  const Answer answer = duet_program("replay-log " + (folder / "text"));
  EXPECT_EQ(answer.code, 2);
  EXPECT_THAT(answer.err, HasSubstr("expected an MCAP file"));
}

}  // namespace
}  // namespace duet
