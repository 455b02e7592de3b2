// The facts that a suite's hash and the digests of its policies and controllers cover, and those that they do not.
#include "duet/experiment/plan/run_identity.h"

#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/experiment/plan/switches.h"
#include "duet/experiment/suite/suite.h"
#include "duet/metrics/contact_limits.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr const char* kSuite = R"(schema: duet.suite/1
name: s
version: 1.0.0
clips: {synth: {per_task: 2}}
engines: [playback, mujoco]
controllers: [vmc]
policies: [replay]
)";

Suite suite_with(const Overrides& overrides = {}) { return parse_suite(kSuite, "s.yaml", overrides); }

TEST(SuiteHash, IsOfWhatRowsOfOneTableMustAgreeOn) {
  const std::string hash = suite_hash(suite_with());
  const std::vector<std::pair<std::string, std::string>> changes = {{"name", "other"},
                                                                    {"version", "2.0.0"},
                                                                    {"seed", "3"},
                                                                    {"tasks", "[hug]"},
                                                                    {"controllers", "[pd]"},
                                                                    {"clips.synth.per_task", "3"},
                                                                    {"start", "clip"},
                                                                    {"start_radius", "0.5"},
                                                                    {"partner", "solid"},
                                                                    {"fuse_ticks", "3"},
                                                                    {"profile", "fast"},
                                                                    {"episodes_per_clip", "2"},
                                                                    {"null_arm", "false"},
                                                                    {"detector.version", "paper"},
                                                                    {"perturbations", "[clean, delay]"},
                                                                    {"robot", "g1_27dof"},
                                                                    {"dt", "0.001"}};
  for (const auto& change : changes) EXPECT_NE(suite_hash(suite_with({change})), hash) << change.first;
}

// Two people run one suite, each with a policy of their own.
TEST(SuiteHash, IsNotOfThePoliciesAndEngines) {
  const std::string hash = suite_hash(suite_with());
  EXPECT_EQ(suite_hash(suite_with({{"policies", "[replay_dense, dstar]"}})), hash);
  EXPECT_EQ(suite_hash(suite_with({{"engines", "[mujoco, bullet, ode]"}})), hash);
}

// An engine's own defaults are written out where the engine is installed; they are no part of the suite.
TEST(SuiteHash, DoesNotDependOnWhichEnginesAreInstalled) {
  const Suite suite = suite_with({{"profile", "parity"}});
  const std::string text = resolved_yaml(suite);
  EXPECT_THAT(text, HasSubstr("bullet: {dt: 0.002, erp: 0.2, iterations: 20}\n"));
  Suite silent = suite;
  silent.profile.engines["bullet"].options.clear();
  EXPECT_THAT(resolved_yaml(silent), HasSubstr("bullet: {dt: 0.002}\n"));
}

// Suites that leave the link to the card have the hash of before the card named it.
TEST(SuiteHash, ALinkThatIsNotNamedCountsAsTheCards) {
  EXPECT_EQ(suite_hash(suite_with({{"perturbations", "[push, mass]"}})),
            suite_hash(suite_with({{"perturbations", "[{push: {link: torso_link}}, {mass: {link: torso_link}}]"}})));
  EXPECT_NE(suite_hash(suite_with({{"perturbations", "[push]"}})),
            suite_hash(suite_with({{"perturbations", "[{push: {link: pelvis}}]"}})));
}

TEST(SuiteHash, LimitsCountByContentWhereThePartnerIsSolid) {
  const test::ScratchFolder folder;
  const std::string shipped = default_contact_limits_path();
  std::filesystem::copy(shipped, folder / "same.yaml");
  write_file(folder / "other.yaml", read_file(shipped) + "# another\n");
  const auto hash = [&](const std::string& file, const char* partner) {
    return suite_hash(suite_with({{"partner", partner}, {"contact_limits", file}}));
  };
  EXPECT_EQ(hash(folder / "same.yaml", "solid"), suite_hash(suite_with({{"partner", "solid"}})));
  EXPECT_NE(hash(folder / "other.yaml", "solid"), suite_hash(suite_with({{"partner", "solid"}})));
  EXPECT_EQ(hash(folder / "other.yaml", "ghost"), suite_hash(suite_with({{"partner", "ghost"}})));
}

// A folder that stands for the files that ship with duet, one of them another.
class OtherShare {
 public:
  OtherShare(const std::string& relative, const std::string& content) {
    write_file(folder_ / relative, content);
    setenv("DUET_SHARE", (folder_ / "").c_str(), 1);
  }
  ~OtherShare() { unsetenv("DUET_SHARE"); }
  OtherShare(const OtherShare&) = delete;
  OtherShare& operator=(const OtherShare&) = delete;

 private:
  test::ScratchFolder folder_;
};

TEST(PolicyDigest, CoversTheNetworkThatShips) {
  for (const auto& [name, file] :
       std::map<std::string, std::string>{{"dstar", "policies/dstar/dstar_braced.safetensors"},
                                          {"dp", "policies/dstar/dp_braced.safetensors"},
                                          {"retrieval", "policies/dstar/retrieval.safetensors"}}) {
    const ActorIdentity before = identity_of(SuitePolicy{name});
    ASSERT_THAT(before.files, SizeIs(1));
    EXPECT_THAT(before.digest, SizeIs(64));
    const OtherShare other(file, "other weights");
    EXPECT_NE(identity_of(SuitePolicy{name}).digest, before.digest) << name;
  }
}

TEST(PolicyDigest, IsOfTheNetworkNotOfItsPlace) {
  const test::ScratchFolder folder;
  std::filesystem::copy(share_file("network", "policies/dstar/dp_braced.safetensors"), folder / "mine.safetensors");
  SuitePolicy given{"dp"};
  given.options = {{"network", folder / "mine.safetensors"}};
  EXPECT_EQ(identity_of(given).digest, identity_of(SuitePolicy{"dp"}).digest);
  SuitePolicy renamed{"another_name", "dp"};
  EXPECT_EQ(identity_of(renamed).digest, identity_of(SuitePolicy{"dp"}).digest);
}

TEST(PolicyDigest, CoversOptionsPromptAndPartner) {
  const std::string plain = identity_of(SuitePolicy{"dstar"}).digest;
  SuitePolicy policy{"dstar"};
  policy.options = {{"temperature", "0.5"}};
  EXPECT_NE(identity_of(policy).digest, plain);
  policy = SuitePolicy{"dstar"};
  policy.prompt = "hug me";
  EXPECT_NE(identity_of(policy).digest, plain);
  policy = SuitePolicy{"dstar"};
  policy.shuffled_partner = true;
  EXPECT_NE(identity_of(policy).digest, plain);
  EXPECT_NE(identity_of(SuitePolicy{"replay"}).digest, identity_of(SuitePolicy{"replay_dense"}).digest);
}

TEST(PolicyDigest, CoversTheProgramBesideADescriptor) {
  const test::ScratchFolder folder;
  const std::string descriptor =
      "schema: duet.policy/1\nname: mine\nabout: x\nkind: process\ncommand: [python3, mine.py, /etc/hostname]\n";
  write_file(folder / "mine.yaml", descriptor);
  write_file(folder / "mine.py", "one");
  const SuitePolicy policy{"mine", folder / "mine.yaml"};
  const ActorIdentity before = identity_of(policy);
  ASSERT_THAT(before.files, SizeIs(2));  // what lies elsewhere is the machine's
  EXPECT_EQ(before.files[1].role, "command mine.py");
  write_file(folder / "module.py", "imported by mine.py");
  EXPECT_NE(identity_of(policy).digest, before.digest);
  std::filesystem::remove(folder / "module.py");
  write_file(folder / "mine.py", "two");
  EXPECT_NE(identity_of(policy).digest, before.digest);
  write_file(folder / "mine.py", "one");
  EXPECT_EQ(identity_of(policy).digest, before.digest);
  write_file(folder / "mine.yaml", descriptor + "# changed\n");
  EXPECT_NE(identity_of(policy).digest, before.digest);
}

TEST(ControllerDigest, CoversTheNetworkThatShips) {
  const ActorIdentity before = identity_of(SuiteController{"wbc_sim"});
  ASSERT_THAT(before.files, SizeIs(1));
  const OtherShare other("controllers/wbc_sim/braced.safetensors", "other weights");
  EXPECT_NE(identity_of(SuiteController{"wbc_sim"}).digest, before.digest);
  EXPECT_EQ(suite_hash(suite_with({{"controllers", "[wbc_sim]"}})), [&] {
    unsetenv("DUET_SHARE");
    return suite_hash(suite_with({{"controllers", "[wbc_sim]"}}));
  }());  // told by each row
}

TEST(ControllerDigest, CoversTheNetworkFoundThroughTheEnvironment) {
  const test::ScratchFolder folder;
  std::filesystem::create_directories(folder / "models");
  setenv("DUET_MODELS", (folder / "models").c_str(), 1);
  const std::string network = [] {
    for (const ControllerInfo& info : controllers())
      if (info.name == "twist2")
        for (const ControllerOption& option : info.options)
          if (option.name == "network") return option.fallback;
    return std::string();
  }();
  ASSERT_FALSE(network.empty());
  const std::string file = folder / ("models/" + std::filesystem::path(network).filename().string());
  write_file(file, "one");
  const ActorIdentity one = identity_of(SuiteController{"twist2"});
  write_file(file, "two");
  const ActorIdentity two = identity_of(SuiteController{"twist2"});
  unsetenv("DUET_MODELS");
  EXPECT_THAT(one.digest, SizeIs(64));
  EXPECT_NE(one.digest, two.digest);
}

// An ONNX file whose numbers lie in another: tensor W, (1) of float, data_location EXTERNAL, location "w.data".
std::string external_model() {
  const std::string location = "\x0a\x08location\x12\x06w.data";
  const std::string tensor =
      "\x08\x01\x10\x01\x42\x01W\x6a" + std::string(1, static_cast<char>(location.size())) + location + "\x70\x01";
  const std::string graph = "\x2a" + std::string(1, static_cast<char>(tensor.size())) + tensor;
  return "\x3a" + std::string(1, static_cast<char>(graph.size())) + graph;
}

TEST(ControllerDigest, CoversTheExternalDataOfItsNetwork) {
  const test::ScratchFolder folder;
  write_file(folder / "net.onnx", external_model());
  write_file(folder / "w.data", "one!");
  SuiteController controller{"twist2"};
  controller.options = {{"network", folder / "net.onnx"}};
  const ActorIdentity one = identity_of(controller);
  ASSERT_THAT(one.files, SizeIs(3));
  EXPECT_EQ(one.files[2].role, "network data w.data");
  EXPECT_EQ(one.files[2].path, folder / "w.data");
  write_file(folder / "w.data", "two!");
  EXPECT_NE(identity_of(controller).digest, one.digest);
  write_file(folder / "w.data", "one!");
  EXPECT_EQ(identity_of(controller).digest, one.digest);
}

TEST(ControllerDigest, OfOneThatIsAbsentIsEmptyAndSaysWhy) {
  SuiteController controller{"twist2"};
  controller.options = {{"network", "/nowhere/twist2.onnx"}};
  const ActorIdentity identity = identity_of(controller);
  EXPECT_EQ(identity.digest, "");
  EXPECT_SENTENCE(identity.absence);
}

TEST(RunIdentity, NamesEveryActorAndTheNullArm) {
  const RunIdentity identity = identity_of(suite_with({{"policies", "[replay, {name: blind, use: replay}]"}}));
  EXPECT_THAT(identity.policies, SizeIs(3));
  EXPECT_THAT(identity.policies.at(kNullPolicy), SizeIs(64));
  EXPECT_EQ(identity.policies.at("blind"), identity.policies.at("replay"));
  EXPECT_THAT(identity.controllers, SizeIs(1));
}

Suite suite_in(const std::string& engines, const std::string& more = "") {
  return parse_suite(
      "schema: duet.suite/1\nname: test\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\nengines: [" +
          engines + "]\ncontrollers: [pd]\npolicies: [replay]\ncontrols: [omni]\n" + more,
      "test.yaml");
}

SwitchedSuite switched(const std::string& engines, const SwitchOptions& options) {
  return SwitchedSuite(suite_in(engines), options);
}

std::string refusal(const std::string& engines, const SwitchOptions& options) {
  return thrown_message<std::invalid_argument>([&] { switched(engines, options); });
}

TEST(Switches, AreWhatDiffersInGroupsThatMeanOneThing) {
  const SwitchedSuite suite =
      switched("mujoco", {.from = "parity", .to = "dt=0.001,cone=pyramidal,iterations=5,solver=cg"});
  EXPECT_THAT(suite.names(), ElementsAre("dt", "friction", "solver"));
  EXPECT_EQ(suite.switches()[0].text(), "dt 0.002 -> 0.001");
  EXPECT_EQ(suite.switches()[2].text(), "iterations 20 -> 5, solver newton -> cg");
  EXPECT_EQ(suite.cells(), 8U);
  EXPECT_EQ(suite.cell_name(0), "from");
  EXPECT_EQ(suite.cell_name(5), "dt+solver");
  EXPECT_EQ(suite.cell_name(7), "to");
}

TEST(Switches, LawAndArmatureAreSwitchesLikeOthers) {
  const SwitchedSuite suite = switched("bullet", {.from = "parity", .to = "dt=0.001,law=explicit,armature=0"});
  EXPECT_THAT(suite.names(), ElementsAre("law", "armature", "dt"));
  EXPECT_EQ(suite.switches()[0].text(), "law implicit -> explicit");
  EXPECT_EQ(suite.cell(1).profile.settings("bullet").law, TorqueLaw::kExplicit);
  EXPECT_EQ(suite.cell(1).profile.settings("bullet").armature, 1.0);
  EXPECT_EQ(suite.cell(6).profile.settings("bullet").armature, 0.0);
}

TEST(Switches, ACellHasItsSwitchesTurnedAndNoOthers) {
  const SwitchedSuite suite = switched("playback, mujoco", {.from = "", .to = "dt=0.001,cone=pyramidal"});
  const Suite from = suite.cell(0), step = suite.cell(1), to = suite.cell(3);
  EXPECT_THAT(from.engines, ElementsAre("mujoco"));
  EXPECT_FALSE(from.null_arm);
  EXPECT_THAT(from.controls, IsEmpty());
  EXPECT_EQ(settings_digest("mujoco", from.profile.settings("mujoco")),
            settings_digest("mujoco", load_profile("parity").settings("mujoco")));
  EXPECT_EQ(step.profile.settings("mujoco").dt, 0.001);
  EXPECT_EQ(step.profile.settings("mujoco").options.at("cone"), "elliptic");
  EXPECT_EQ(to.profile.settings("mujoco").options.at("cone"), "pyramidal");
  EXPECT_EQ(to.profile.name, "to");
}

TEST(Switches, OneSwitchTurnsWhatEachEngineCallsIt) {
  const SwitchedSuite suite = switched("mujoco, bullet", {.from = "parity", .to = "fast"});
  EXPECT_THAT(suite.names(), ElementsAre("dt", "solver"));
  EXPECT_EQ(suite.switches()[0].text(), "dt 0.002 -> 0.004");
  EXPECT_THAT(suite.switches()[1].text(), AllOf(HasSubstr("iterations 20 -> 10")));
  EXPECT_EQ(suite.cell(2).profile.settings("bullet").options.at("iterations"), "10");
  EXPECT_EQ(suite.cell(2).profile.settings("bullet").dt, 0.002);
}

TEST(Switches, ASettingOfOneEngineLeavesTheOthersAlone) {
  const SwitchedSuite suite = switched("mujoco, bullet", {.from = "parity", .to = "mujoco.dt=0.001"});
  EXPECT_EQ(suite.switches()[0].text(), "mujoco: dt 0.002 -> 0.001");
  EXPECT_EQ(suite.cell(1).profile.settings("bullet").dt, 0.002);
}

TEST(Switches, AGroupIsWhatTheCallerSays) {
  const SwitchedSuite suite =
      switched("bullet", {.from = "parity", .to = "dt=0.001,erp=0.5", .names = {{"dt", "both"}, {"erp", "both"}}});
  EXPECT_THAT(suite.names(), ElementsAre("both"));
}

TEST(Switches, AnotherEngineIsASwitch) {
  const SwitchedSuite suite = switched("bullet", {.from = "parity", .to = "dt=0.001,engine=mujoco"});
  EXPECT_THAT(suite.names(), ElementsAre("dt", "engine"));
  EXPECT_THAT(suite.cell(1).engines, ElementsAre("bullet"));
  EXPECT_THAT(suite.cell(2).engines, ElementsAre("mujoco"));
  EXPECT_THAT(switched("bullet", {.from = "parity", .to = "erp=0.5,engine=mujoco"}).names(),
              ElementsAre("softness", "engine"));
  EXPECT_EQ(suite.cell(2).profile.settings("mujoco").dt, 0.002);
  EXPECT_EQ(suite.cell(3).profile.settings("mujoco").dt, 0.001);
  EXPECT_EQ(suite.engine_of("mujoco"), "bullet");
  EXPECT_THAT(refusal("bullet, mujoco", {.from = "parity", .to = "engine=ode"}), HasSubstr("expected one engine"));
  EXPECT_THAT(refusal("bullet", {.from = "parity", .to = "engine=bullet"}), HasSubstr("expected another engine"));
  EXPECT_THAT(refusal("bullet", {.from = "engine=ode", .to = "dt=0.001"}), HasSubstr("--to names another"));
}

TEST(Switches, RefusesWhatCannotBeAttributed) {
  EXPECT_THAT(refusal("mujoco", {.from = "parity", .to = "parity"}), HasSubstr("are the same for mujoco"));
  EXPECT_THAT(refusal("bullet", {.from = "parity", .to = "dt=0.001,erp=0.5,iterations=5,stop_erp=0.1,engine=mujoco"}),
              AllOf(HasSubstr("differ in 5 switches (dt, softness, solver, stops, engine)"), HasSubstr("--group")));
  EXPECT_THAT(thrown_message<InputError>([] { switched("bullet", {.from = "parity", .to = "cone=pyramidal"}); }),
              AllOf(HasSubstr("--to: bullet: "), HasSubstr("bullet"), HasSubstr("cone")));
  EXPECT_THAT(thrown_message<InputError>([] { switched("bullet", {.from = "parity", .to = "dt=0.003"}); }),
              HasSubstr("divides 0.02"));
  EXPECT_THAT(thrown_message<InputError>([] { switched("playback", {.from = "parity", .to = "fast"}); }),
              HasSubstr("playback alone"));
  EXPECT_THAT(refusal("bullet", {.from = "parity", .to = "quick"}), HasSubstr("'quick'"));
  EXPECT_THAT(refusal("bullet", {.from = "parity", .to = "dt=0.001,erp"}), HasSubstr("expected KEY=VALUE"));
  EXPECT_THAT(refusal("bullet", {.from = "parity", .to = "mujoco.dt=0.001"}),
              HasSubstr("expected an engine that runs"));
}

}  // namespace
}  // namespace duet
