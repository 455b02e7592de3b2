// `duet hw` and `duet replay-log` as a user types them, with a twin as a second process.
#include <gmock/gmock.h>

#include <thread>

#include "duet/core/file.h"
#include "duet/hardware/guard/person_log.h"
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

// Somebody `ahead` of the camera of examples/hardware/camera.yaml, for two seconds.
std::string person_at(double ahead, const test::ScratchFolder& folder) {
  std::vector<RecordedEstimate> log;
  for (std::uint64_t k = 0; k < 60; ++k) {
    PersonEstimate estimate;
    estimate.sequence = k + 1;
    estimate.stamp = static_cast<double>(k) / 30.0;
    estimate.seen = true;
    for (int j = 0; j < kSmplJoints; ++j) estimate.joints.col(j) = Eigen::Vector3d(0.01 * j, 0.02 * j, ahead);
    log.push_back(recorded(estimate));
  }
  const std::string path = folder / "person.dpj";
  write_file(path, person_log(log));
  return path;
}

TEST(HwCommand, SeeSaysWhatTheRobotWouldDoTaskByTask) {
  const test::ScratchFolder folder;
  const std::string camera = std::string(DUET_SOURCE_DIR) + "/examples/hardware/camera.yaml";
  const std::string command = "hw see " + person_at(4.0, folder) + " --policy null --task wave --task hug --config ";
  const Answer seen = duet_program(command + camera + " --json");
  EXPECT_EQ(seen.code, 0) << seen.err;
  EXPECT_THAT(seen.err, HasSubstr("nothing is written to any robot"));
  EXPECT_THAT(seen.out, HasSubstr("\"used\": 60"));
  EXPECT_THAT(seen.out, HasSubstr("\"task\": \"hug\""));
  EXPECT_THAT(duet_program(command + camera).out, HasSubstr("estimates: 60 used, 0 without anybody, 0 refused\n"));
  write_file(folder / "blind.yaml", config_of());
  const Answer blind = duet_program(command + (folder / "blind.yaml"));
  EXPECT_EQ(blind.code, 2);
  EXPECT_THAT(blind.err, HasSubstr("expected a 'camera', which says where the estimates are from, found none"));
  const Answer focal = duet_program(command + camera + " --focal-length 900");
  EXPECT_EQ(focal.code, 2);
  EXPECT_THAT(focal.err, HasSubstr("expected both or none of them, found one"));
  const Answer far =
      duet_program("hw see " + person_at(55.0, folder) + " --policy null --task wave --config " + camera);
  EXPECT_EQ(far.code, 3);
  EXPECT_THAT(far.out, HasSubstr("does not run: no estimate could be used"));
  EXPECT_THAT(far.out, HasSubstr("60 far (a joint further than 20 m from the camera"));
}

TEST(HwCommand, CalibratePrintsTheCameraOrSaysWhatIsMissing) {
  const test::ScratchFolder folder;
  person_at(2.0, folder);
  const std::string head = "schema: duet.calibration/1\nlog: person.dpj\nheight: 0.74\nplaces:\n";
  write_file(folder / "two.yaml", head + "  - {at: [2, 0], seconds: [0, 1]}\n  - {at: [3, 1], seconds: [1, 2]}\n");
  const Answer two = duet_program("hw calibrate " + (folder / "two.yaml"));
  EXPECT_EQ(two.code, 2);
  EXPECT_THAT(two.err, HasSubstr("expected at least 3 places where somebody stood, found 2"));
  // Somebody who never moved stood at three places: no camera fits, and the residual says so.
  write_file(folder / "still.yaml", head +
                                        "  - {at: [2, 0], seconds: [0, 0.6]}\n  - {at: [3, 1], seconds: [0.7, 1.2]}\n"
                                        "  - {at: [3, -1], seconds: [1.3, 1.9]}\n");
  const Answer still = duet_program("hw calibrate " + (folder / "still.yaml") + " --config " + DUET_SOURCE_DIR +
                                    "/examples/hardware/camera.yaml");
  EXPECT_EQ(still.code, 1);
  EXPECT_THAT(still.out, HasSubstr("camera:\n  position: ["));
  EXPECT_THAT(still.out, HasSubstr("standard errors: position"));
  EXPECT_THAT(still.out, HasSubstr("not good: expected a residual of at most 0.1 m"));
}

}  // namespace
}  // namespace duet
