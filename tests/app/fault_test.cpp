// Engines that are missing, broken or fail in mid-episode: said by name, and the others go on. The program is run as a
// user runs it, with a folder of engines of the test's own ($DUET_ENGINES).
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <map>

#include "duet/app/certificate.h"
#include "duet/core/file.h"
#include "duet/rows/folder/run_directory.h"
#include "tests/app/program.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

struct Ended {
  int code = -1;
  std::string text;  // both streams
};

class Faults : public testing::Test {
 protected:
  Faults() {
    fs::create_directory(engines());
    for (const auto& entry : fs::directory_iterator(test::built_engines()))
      fs::create_symlink(entry.path(), fs::path(engines()) / entry.path().filename());
    fs::create_symlink(DUET_FAULTY_ENGINE, fs::path(engines()) / "duet_faulty.so");
    fs::create_symlink(DUET_ALTERED_ENGINE, fs::path(engines()) / "duet_altered.so");
    fs::create_symlink(DUET_PARTNERLESS_ENGINE, fs::path(engines()) / "duet_partnerless.so");
    fs::create_symlink(DUET_HOSTED_ENGINE, fs::path(engines()) / "duet_hosted.so");
  }
  [[nodiscard]] std::string engines() const { return folder_ / "engines"; }

  [[nodiscard]] Ended run(const std::string& arguments) const {
    const std::string command = "DUET_ENGINES='" + engines() + "' '" + test::program() + "' " + arguments + " 2>&1";
    FILE* pipe = popen(command.c_str(), "r");
    Ended ended;
    std::array<char, 4096> buffer{};
    while (const size_t count = fread(buffer.data(), 1, buffer.size(), pipe)) ended.text.append(buffer.data(), count);
    ended.code = WEXITSTATUS(pclose(pipe));
    return ended;
  }

  // A suite of one clip in these engines, `fault` in the failing one.
  [[nodiscard]] std::string suite(const std::string& engine_names, const std::string& fault = "throw",
                                  const std::string& controllers = "pd", const std::string& failing = "faulty") const {
    std::string path = folder_ / "suite.yaml";
    write_file(path,
               "schema: duet.suite/1\nname: faults\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
               "engines: [" +
                   engine_names + "]\ncontrollers: [" + controllers + "]\npolicies: [replay]\nnull_arm: false\n" +
                   "profile: {name: mine, engines: {" + failing + ": {fault: " + fault + "}}}\n");
    return path;
  }

  [[nodiscard]] std::map<std::string, EpisodeRow> rows() const {
    std::map<std::string, EpisodeRow> by_engine;
    for (const EpisodeRow& row : load_run(folder_ / "run").rows) by_engine[row.engine] = row;
    return by_engine;
  }

  test::ScratchFolder folder_;
};

TEST_F(Faults, AModuleInTheFolderIsAnEngine) {
  const Ended ended = run("list engines");
  EXPECT_EQ(ended.code, 0);
  EXPECT_THAT(ended.text, HasSubstr("faulty"));
}

// Nothing of it moves: no pendulum swings, nothing falls or slides.
TEST_F(Faults, AnEngineThatStandsStillFailsItsScenesAndAllAreReported) {
  const Ended ended = run("validate --engine faulty --effort quick -q");
  EXPECT_EQ(ended.code, 5) << ended.text;
  EXPECT_THAT(ended.text, AllOf(HasSubstr("pendulum"), HasSubstr("chain"), HasSubstr("stand")));
}

// The output of `validate --json`.
nlohmann::json certificate_of(const Ended& ended) {
  const std::size_t begin = ended.text.find('{');
  return begin == std::string::npos ? nlohmann::json() : nlohmann::json::parse(ended.text.substr(begin));
}

// The scenes of two bodies: each of these faults of a contact code passed all checks once.
TEST_F(Faults, AContactCodeThatForgetsThePartnersMotionOrAFrictionFailsTwoChecksOrMore) {
  int tried = 0;
  for (const char* engine : {"mujoco", "bullet", "dart", "ode", "simbody"}) {
    if (!fs::exists(fs::path(engines()) / (std::string("duet_") + engine + ".so"))) continue;
    const auto failed = [&](const std::string& fault) {
      const std::string profile = folder_ / "altered.yaml";
      write_file(profile, std::string("schema: duet.profile/1\nname: altered\nabout: a fault\nengines:\n") +
                              "  altered: {engine: " + engine + ", fault: " + fault + "}\n");
      const Ended ended = run("validate -q --json --engine altered --profile " + profile +
                              " --scene skin-bounce,skin-rub,skin-carry,self-rub");
      return certificate_of(ended).at("engines").at(0).at("failed").get<int>();
    };
    const int sound = failed("none");
    for (const char* fault : {"deaf", "slick", "slick_self"})
      EXPECT_GE(failed(fault), sound + 2) << engine << ", " << fault;
    ++tried;
  }
  if (tried == 0) GTEST_SKIP() << "not run: no physics engine is there";
}

TEST_F(Faults, AnEngineWithoutASolidPartnerIsCertifiedWithoutOne) {
  if (!fs::exists(fs::path(engines()) / "duet_mujoco.so")) GTEST_SKIP() << "not run: engine mujoco absent";
  const Ended ended =
      run("validate --engine partnerless --scene skin-bounce,held-push,repeat -o " + (folder_ / "parity"));
  EXPECT_EQ(ended.code, 0) << ended.text;
  EXPECT_THAT(ended.text, AllOf(HasSubstr("6 passed, 0 asserted deviations, 0 failed, 3 unsupported"),
                                HasSubstr("3 checks are unsupported: it has no solid partner (its people are air)")));
  const Certificate read = load_certificate(folder_ / "parity/certificate.json");
  EXPECT_EQ(read.engines[0].tally.unsupported, 3);
  EXPECT_EQ(read.engines[0].measurements[0].verdict, conformance::CheckStatus::kUnsupported);
}

TEST_F(Faults, AnEngineWithoutASolidPartnerHasRowsThatSaySoWhereTheSuiteHasOne) {
  if (!fs::exists(fs::path(engines()) / "duet_mujoco.so")) GTEST_SKIP() << "not run: engine mujoco absent";
  const Ended ended = run("run " + suite("playback, partnerless") + " -s partner=solid -q -o " + (folder_ / "run"));
  EXPECT_EQ(ended.code, 3) << ended.text;
  EXPECT_EQ(rows().at("partnerless").outcome, Outcome::kUnsupported);
  EXPECT_THAT(
      rows().at("partnerless").message,
      HasSubstr("engine 'partnerless' has no solid partner (its people are air): expected the partner ghost or"));
  const Ended alone = run("run " + suite("partnerless") + " -s partner=solid -q -o " + (folder_ / "alone"));
  EXPECT_EQ(alone.code, 4) << alone.text;
  EXPECT_FALSE(fs::exists(folder_ / "alone"));
  EXPECT_EQ(run("run " + suite("partnerless") + " -q -o " + (folder_ / "ghost")).code, 0);
}

TEST_F(Faults, WhatIsNotInTheFoldersThatWereGivenIsSaidToBeThere) {
  fs::remove(fs::path(engines()) / "duet_ode.so");
  EXPECT_THAT(run("list engines").text,
              HasSubstr("no duet_ode.so in the folders of DUET_ENGINES ('" + engines() + "')"));
}

TEST_F(Faults, AnEngineThatThrowsEndsItsEpisodeByNameAndTheOthersGoOn) {
  const Ended ended = run("run " + suite("playback, faulty") + " -q -o " + (folder_ / "run"));
  EXPECT_EQ(ended.code, 3) << ended.text;
  const auto row = rows();
  ASSERT_EQ(row.size(), 2U);
  EXPECT_EQ(row.at("faulty").outcome, Outcome::kError);
  EXPECT_THAT(row.at("faulty").message, HasSubstr("faulty: an error of the engine itself"));
  EXPECT_EQ(row.at("faulty").success, false);
  EXPECT_EQ(row.at("playback").outcome, Outcome::kOk);
}

TEST_F(Faults, AHostThatDiesOrLiesIsARowWithItsMessageAndTheOthersGoOn) {
  if (system("python3 -c ''") != 0) GTEST_SKIP() << "not run: python3 absent";
  const std::map<std::string, std::string> faults = {
      {"exit", "hosted: its host ended with exit status 7 before it answered message 201"},
      {"nan", "hosted: number 5 of its host's answer at 0.3980 s is not finite"},
      {"short", "hosted: its host answers message 201 with"},
      {"echo", "hosted: its host answers message 202, expected 201"},
      {"say", "hosted: its solver met a wall"}};
  for (const auto& [fault, message] : faults) {
    const std::string run_it =
        "run " + suite("playback, hosted", fault, "pd", "hosted") + " -q -o " + (folder_ / "run");
    const Ended ended = run(run_it);
    EXPECT_EQ(ended.code, 3) << ended.text;
    const auto row = rows();
    EXPECT_EQ(row.at("hosted").outcome, Outcome::kError) << fault;
    EXPECT_THAT(row.at("hosted").message, HasSubstr(message));
    EXPECT_EQ(row.at("playback").outcome, Outcome::kOk);
    fs::remove_all(folder_ / "run");
  }
}

TEST_F(Faults, AnEngineThatDivergesSaysSoByName) {
  const Ended ended = run("run " + suite("playback, faulty", "diverge") + " -q -o " + (folder_ / "run"));
  EXPECT_EQ(ended.code, 0) << ended.text;
  const auto row = rows();
  EXPECT_EQ(row.at("faulty").outcome, Outcome::kDiverged);
  EXPECT_THAT(row.at("faulty").message, AllOf(HasSubstr("faulty"), HasSubstr("diverged at 0.5")));
  EXPECT_EQ(row.at("playback").outcome, Outcome::kOk);
}

TEST_F(Faults, AnEngineWhoseLibraryIsMissingHasRowsThatSayWhy) {
  fs::remove(fs::path(engines()) / "duet_ode.so");
  write_file((fs::path(engines()) / "duet_ode.so").string(), "not a shared object");
  const Ended ended = run("run " + suite("playback, ode") + " -o " + (folder_ / "run"));
  EXPECT_EQ(ended.code, 3) << ended.text;
  EXPECT_THAT(ended.text, HasSubstr("engine 'ode' is absent"));
  const auto row = rows();
  ASSERT_EQ(row.size(), 2U);
  EXPECT_EQ(row.at("ode").outcome, Outcome::kUnsupported);
  EXPECT_THAT(row.at("ode").message, HasSubstr("duet_ode.so"));
  EXPECT_EQ(row.at("playback").outcome, Outcome::kOk);
}

TEST_F(Faults, ARunWithNoEngineAtAllIsRefused) {
  fs::remove(fs::path(engines()) / "duet_ode.so");
  const Ended ended = run("run " + suite("ode") + " -q -o " + (folder_ / "run"));
  EXPECT_EQ(ended.code, 4) << ended.text;
  EXPECT_THAT(ended.text, AllOf(HasSubstr("engine 'ode' is absent"), HasSubstr("duet_ode.so")));
  EXPECT_FALSE(fs::exists(folder_ / "run"));
}

constexpr const char* kLost = "{name: lost, use: homie, options: {network: nowhere.onnx}}";

TEST_F(Faults, AControllerWhoseNetworkIsMissingHasRowsThatSayWhyAndTheOthersGoOn) {
  const std::string run_it =
      "run " + suite("playback, faulty", "none", std::string("pd, ") + kLost) + " -o " + (folder_ / "run");
  const Ended ended = run(run_it);
  EXPECT_EQ(ended.code, 3) << ended.text;
  EXPECT_THAT(ended.text, AllOf(HasSubstr("controller 'lost' is absent"), HasSubstr("nowhere.onnx")));
  std::map<std::string, EpisodeRow> row;
  for (const EpisodeRow& found : load_run(folder_ / "run").rows) row[found.engine + " " + found.controller] = found;
  EXPECT_EQ(row.at("faulty lost").outcome, Outcome::kUnsupported);
  EXPECT_THAT(row.at("faulty lost").message, HasSubstr("nowhere.onnx"));
  EXPECT_EQ(row.at("faulty lost").robot_digest, "");
  EXPECT_EQ(row.at("faulty pd").outcome, Outcome::kOk) << row.at("faulty pd").message;
  EXPECT_EQ(row.at("playback pd").outcome, Outcome::kOk);
  EXPECT_EQ(run("run " + (folder_ / "suite.yaml") + " --controllers pd -q -o " + (folder_ / "part")).code, 0);
}

TEST_F(Faults, ARunWithNoControllerAtAllIsRefused) {
  const Ended ended = run("run " + suite("faulty", "none", kLost) + " -q -o " + (folder_ / "run"));
  EXPECT_EQ(ended.code, 4) << ended.text;
  EXPECT_THAT(ended.text, AllOf(HasSubstr("controller 'lost' is absent"), HasSubstr("nowhere.onnx")));
  EXPECT_FALSE(fs::exists(folder_ / "run"));
}

TEST_F(Faults, ANetworkIsForAControllerOfTheSuiteThatHasOne) {
  const std::string run_it = "run " + suite("playback", "none", std::string("pd, ") + kLost) + " --dry-run --network ";
  EXPECT_THAT(run(run_it + "lost=elsewhere.onnx").text, HasSubstr("/elsewhere.onnx"));
  EXPECT_THAT(run(run_it + "pd=x.onnx").text,
              HasSubstr("controller 'pd': unknown option 'network'. Known: explicit_step"));
  EXPECT_THAT(run(run_it + "losst=x.onnx").text, HasSubstr("did you mean 'lost'"));
  EXPECT_EQ(run(run_it + "lost").code, 2);
}

TEST_F(Faults, DoctorNamesABrokenModule) {
  fs::remove(fs::path(engines()) / "duet_dart.so");
  write_file((fs::path(engines()) / "duet_dart.so").string(), "not a shared object");
  const Ended ended = run("doctor --need dart");
  EXPECT_EQ(ended.code, 4);
  EXPECT_THAT(ended.text, AllOf(HasSubstr("engine 'dart' is absent"), HasSubstr("duet_dart.so")));
}

TEST_F(Faults, ACertificateEditedByHandIsRefusedAndAGoodOneIsKept) {
  const Ended made = run("validate -q --engine mujoco --scene armature -o " + (folder_ / "parity"));
  if (made.code == 4) GTEST_SKIP() << "not run: engine mujoco absent";
  const std::string path = folder_ / "parity/certificate.json";
  const std::string run_it = "run " + suite("playback") + " -q --certificate " + path + " -o " + (folder_ / "run");
  ASSERT_EQ(run(run_it).code, 0);
  EXPECT_EQ(load_run(folder_ / "run").info.certificate.at("engines").at(0).at("name"), "mujoco");
  fs::remove_all(folder_ / "run");
  std::string text = read_file(path);
  text.replace(text.find("\"quick\""), 7, "\"full\"");
  write_file(path, text);
  const Ended refused = run(run_it);
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.text, AllOf(HasSubstr("certificate.json"), HasSubstr("digest")));
  EXPECT_FALSE(fs::exists(folder_ / "run"));
}

TEST_F(Faults, AModuleOfAnotherNameIsRefused) {
  fs::copy_file(DUET_FAULTY_ENGINE, fs::path(engines()) / "duet_other.so");
  EXPECT_THAT(run("list engines").text, HasSubstr("names itself 'faulty'"));
}

// A controller that the filter leaves out cannot stand in for one that is missing.
TEST_F(Faults, ARunOfTheOneControllerThatIsMissingIsRefusedThoughTheSuiteHasOthers) {
  const std::string controllers = std::string("pd, ") + kLost;
  const Ended ended =
      run("run " + suite("faulty", "none", controllers) + " --controllers lost -q -o " + (folder_ / "run"));
  EXPECT_EQ(ended.code, 4) << ended.text;
  EXPECT_THAT(ended.text, HasSubstr("controller 'lost' is absent"));
  EXPECT_FALSE(fs::exists(folder_ / "run"));
}

}  // namespace
}  // namespace duet
