#include "duet/execution/runner.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "duet/archives/recording_file.h"
#include "duet/backends/engine_module.h"
#include "duet/backends/narrow_phase.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/clips.h"
#include "duet/robots/robot_cards.h"
#include "tests/execution/staged.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

RunSummary run(const Suite& suite, const std::string& folder, const RunOptions& options = {}) {
  Progress quiet(Progress::Style::kQuiet);
  return run_suite(suite, folder, options, quiet);
}

TEST(Runner, RunsTheNullArmBesideEveryPolicy) {
  const test::ScratchFolder folder;
  const RunSummary summary = run(test::playback_suite(), folder / "run");
  EXPECT_EQ(summary.planned, 4);
  EXPECT_EQ(summary.run, 4);
  const duet::Run loaded = load_run(folder / "run");
  int null_rows = 0;
  for (const EpisodeRow& row : loaded.rows) null_rows += row.arm == "null" ? 1 : 0;
  EXPECT_EQ(null_rows, 2);
}

TEST(Runner, SecondCallRunsNothing) {
  const test::ScratchFolder folder;
  run(test::playback_suite(), folder / "run");
  const std::string before = read_file(folder / "run/episodes.jsonl");
  const RunSummary summary = run(test::playback_suite(), folder / "run");
  EXPECT_EQ(summary.already_there, 4);
  EXPECT_EQ(summary.run, 0);
  EXPECT_EQ(read_file(folder / "run/episodes.jsonl"), before);
}

TEST(Runner, KilledRunResumesFromItsLastWholeRow) {
  const test::ScratchFolder folder;
  run(test::playback_suite(), folder / "run");
  const std::string path = folder / "run/episodes.jsonl";
  const std::string whole = read_file(path);
  std::ofstream(path, std::ios::trunc) << whole.substr(0, whole.find('\n') + 40);  // one row and a torn one
  const RunSummary summary = run(test::playback_suite(), folder / "run");
  EXPECT_EQ(summary.already_there, 1);
  EXPECT_EQ(summary.run, 3);
  EXPECT_EQ(load_run(folder / "run").rows.size(), 4u);
}

TEST(Runner, ThreadsDoNotChangeResults) {
  const test::ScratchFolder folder;
  RunOptions two;
  two.threads = 2;
  run(test::playback_suite(), folder / "one");
  run(test::playback_suite(), folder / "two", two);
  std::map<std::string, std::string> hashes;
  for (const EpisodeRow& row : load_run(folder / "one").rows) hashes[row.key] = row.state_hash;
  for (const EpisodeRow& row : load_run(folder / "two").rows) EXPECT_EQ(hashes.at(row.key), row.state_hash) << row.clip;
}

// Handshakes in playback, which replay fulfils and a robot that stands still does not: told apart after a few clips.
Suite decidable_suite() {
  return parse_suite(
      "schema: duet.suite/1\nname: test\nversion: 1.0.0\nclips: {synth: {per_task: 8}}\ntasks: [handshake]\n"
      "engines: [playback]\ncontrollers: [pd]\npolicies: [replay, {name: still, use: 'null'}]\nstart: clip\n",
      "test.yaml");
}

RunOptions until_decided(int threads) {
  RunOptions options;
  options.threads = threads;
  options.decide = {.policies = {"replay", "still"}, .alpha = 0.4};
  options.episodes_per_look = 3;  // one clip: two policies and the null arm
  return options;
}

TEST(Runner, StopsWhenDecidedAtTheSameEpisodeWhateverTheThreadsAndGoesOnToTheFullRun) {
  const test::ScratchFolder folder;
  const RunSummary one = run(decidable_suite(), folder / "one", until_decided(1));
  ASSERT_TRUE(one.decided.has_value());
  EXPECT_EQ(one.decided->decision.pairs.at(0).verdict, SequentialDecision::kBetter);
  EXPECT_EQ(one.end, RunEnd::kComplete);
  EXPECT_EQ(one.planned, 24);
  EXPECT_LT(one.run, 24);
  EXPECT_EQ(one.run, one.decided->used);
  EXPECT_EQ(one.decided->saved(), 24 - one.run);
  run(decidable_suite(), folder / "two", until_decided(2));
  EXPECT_EQ(read_file(folder / "one/decision.json"), read_file(folder / "two/decision.json"));
  std::map<std::string, std::string> hashes;
  for (const EpisodeRow& row : load_run(folder / "one").rows) hashes[row.key] = row.state_hash;
  EXPECT_EQ(load_run(folder / "two").rows.size(), hashes.size());
  for (const EpisodeRow& row : load_run(folder / "two").rows) EXPECT_EQ(hashes.at(row.key), row.state_hash);
  // A stopped run is a part of the full one, whose later rows change no decision.
  EXPECT_EQ(run(decidable_suite(), folder / "two").run, 24 - one.run);
  const std::string before = read_file(folder / "two/decision.json");
  const RunSummary again = run(decidable_suite(), folder / "two", until_decided(2));
  EXPECT_EQ(again.run, 0);
  EXPECT_EQ(again.decided->used, one.decided->used);
  EXPECT_EQ(read_file(folder / "two/decision.json"), before);
}

TEST(Runner, ADecisionThatWasKilledComesToTheSameEnd) {
  const test::ScratchFolder folder;
  run(decidable_suite(), folder / "run", until_decided(1));
  const std::string decision = read_file(folder / "run/decision.json");
  const std::string path = folder / "run/episodes.jsonl";
  const std::string whole = read_file(path);
  std::ofstream(path, std::ios::trunc) << whole.substr(0, whole.find('\n') + 40);  // one row and a torn one
  std::filesystem::remove(folder / "run/decision.json");
  EXPECT_EQ(run(decidable_suite(), folder / "run", until_decided(2)).already_there, 1);
  EXPECT_EQ(read_file(folder / "run/decision.json"), decision);
}

TEST(Runner, RefusesADecisionOfPoliciesThatTheSuiteDoesNotHave) {
  const test::ScratchFolder folder;
  RunOptions options = until_decided(1);
  options.decide.policies = {"replay", "dp"};
  const auto refusal = [&] {
    return test::thrown_message<std::invalid_argument>([&] { run(decidable_suite(), folder / "run", options); });
  };
  EXPECT_SENTENCE(refusal());
  options.decide.policies = {"replay"};
  EXPECT_SENTENCE(refusal());
  options.decide.policies = {"replay", "still"};
  options.policies = {"replay"};
  EXPECT_SENTENCE(refusal());
}

TEST(Runner, DirectoryOfAnotherSuiteIsRefused) {
  const test::ScratchFolder folder;
  run(test::playback_suite(), folder / "run");
  Suite other = test::playback_suite();
  other.name = "other";
  const std::string message = test::thrown_message<InputError>([&] { run(other, folder / "run"); });
  EXPECT_SENTENCE(message);
}

TEST(Runner, TimeLimitLeavesAResumableRun) {
  const test::ScratchFolder folder;
  RunOptions options;
  options.time_limit = 1e-9;
  const RunSummary summary = run(test::playback_suite(), folder / "run", options);
  EXPECT_EQ(summary.end, RunEnd::kTimeLimit);
  EXPECT_LT(summary.run, summary.planned);
  EXPECT_EQ(run(test::playback_suite(), folder / "run").end, RunEnd::kComplete);
  EXPECT_EQ(load_run(folder / "run").rows.size(), 4u);
}

TEST(Runner, FiltersThatTheSuiteDoesNotHaveAreRefused) {
  const test::ScratchFolder folder;
  RunOptions options;
  options.tasks = {"hug"};
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { run(test::playback_suite(), folder / "run", options); }));
  options.tasks = {"wave"};
  EXPECT_EQ(run(test::playback_suite(), folder / "run", options).planned, 2);
}

TEST(Runner, ControlsAreChosenByNameAsPoliciesAre) {
  const test::ScratchFolder folder;
  Suite suite = test::playback_suite();
  suite.controls = {"omni", "raised"};
  RunOptions options;
  options.policies = {"raised"};
  run(suite, folder / "run", options);
  std::set<std::string> arms;
  for (const EpisodeRow& row : load_run(folder / "run").rows) arms.insert(row.policy);
  EXPECT_EQ(arms, (std::set<std::string>{"null", "raised"}));
}

TEST(Runner, ATouchInPlaybackCannotBeJudgedByTheRuleInteraction) {
  const test::ScratchFolder folder;
  Suite suite = test::playback_suite();
  suite.detector = DetectorVersion::kInteraction;
  run(suite, folder / "run");
  for (const EpisodeRow& row : load_run(folder / "run").rows) {
    const bool touches = row.task == "handshake";
    EXPECT_EQ(row.message.starts_with("cannot be judged under `interaction`: playback has no physics"), touches);
    if (touches) {
      EXPECT_EQ(row.success, false);
    }
  }
}

TEST(Runner, AnEpisodeThatThrowsBecomesAFailedRow) {
  PairedMotion clip = test::paired(Task::kWave, *test::g1());
  clip.phases = {0, clip.frames() + 10};  // the adaptation refuses it
  const EpisodeRow row = test::experiment_of(test::playback_suite(), {clip})->run(0);
  EXPECT_EQ(row.outcome, Outcome::kError);
  EXPECT_EQ(row.success, false);
  EXPECT_FALSE(row.message.empty());
}

TEST(Runner, ATaskThatThePolicyWasNotMadeForIsAnUnsupportedRow) {
  PairedMotion clip = test::paired(Task::kWave, *test::g1());
  clip.task = all_tasks().back();
  ASSERT_GT(clip.task, Task::kFlyKiss) << "the list has a seventh task";
  Suite suite = test::playback_suite();
  suite.policies = {SuitePolicy{"dstar"}};
  const EpisodeRow row = test::experiment_of(suite, {clip})->run(0);
  EXPECT_EQ(row.outcome, Outcome::kUnsupported);
  EXPECT_EQ(row.success, false);
  EXPECT_SENTENCE(row.message);
}

TEST(Runner, PairedClipsOfTheSameIdAreRefused) {
  const test::ScratchFolder folder;
  const auto robot = test::g1();
  const PairedMotion clip = test::paired(Task::kWave, *robot);
  save_paired_motion(clip, folder / "a.npz");
  save_paired_motion(clip, folder / "b.npz");
  Suite suite = test::playback_suite();
  suite.clips = {};
  suite.clips.files = {folder / "a.npz", folder / "b.npz"};
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { run(suite, folder / "run"); }));
}

TEST(Runner, MujocoEpisodesRepeatBitForBit) {
  for (const EngineInfo& engine : engines())
    if (engine.name == "mujoco" && !engine.available) GTEST_SKIP() << "not run: MuJoCo absent";
  Suite suite = test::playback_suite();
  suite.engines = {"mujoco"};
  suite.controllers = {SuiteController{"vmc"}};
  suite.start = SuiteStart::kAct;
  const auto experiment = test::experiment_of(suite, {test::paired(Task::kWave, *test::g1())});
  const EpisodeSpec spec = test::first_of(*experiment, 7);
  const EpisodeRow first = experiment->run(spec), second = experiment->run(spec);
  EXPECT_EQ(first.outcome, Outcome::kOk) << first.message;
  EXPECT_EQ(first.state_hash, second.state_hash);
  EXPECT_EQ(first.metrics, second.metrics);
}

TEST(Runner, PerturbedEpisodesDifferFromCleanAndRepeat) {
  for (const EngineInfo& engine : engines())
    if (engine.name == "mujoco" && !engine.available) GTEST_SKIP() << "not run: MuJoCo absent";
  Suite suite = test::playback_suite();
  suite.engines = {"mujoco"};
  suite.controllers = {SuiteController{"vmc"}};
  suite.start = SuiteStart::kAct;
  for (const char* kind :
       {"delay", "latency", "noise", "push", "friction", "mass", "actuation"})  // of the body; replay is blind
    suite.perturbations.push_back(default_perturbation(kind));
  suite.perturbations[4] = test::perturbation("{push: {every: 1.5}}");  // within the clip
  const auto experiment = test::experiment_of(suite, {test::paired(Task::kWave, *test::g1())});
  EpisodeSpec spec = test::first_of(*experiment, 7);
  spec.perturbation_seed = 11;
  std::map<std::string, std::string> by_hash;
  for (const Perturbation& perturbation : experiment->suite().perturbations) {
    spec.perturbation = &perturbation;
    const EpisodeRow row = experiment->run(spec);
    EXPECT_TRUE(row.outcome == Outcome::kOk || row.outcome == Outcome::kFell) << row.message;
    EXPECT_EQ(row.perturbation, perturbation.name);
    EXPECT_TRUE(by_hash.emplace(row.state_hash, perturbation.name).second)
        << perturbation.name << " changes nothing: as " << by_hash[row.state_hash];
    if (perturbation.name != "push") continue;
    EXPECT_EQ(experiment->run(spec).state_hash, row.state_hash);
  }
}

TEST(Experiment, SceneHasThePerturbationsActuationAndElseTheProfiles) {
  Suite suite = test::playback_suite();
  suite.engines = {"mujoco"};
  suite.profile.engines["mujoco"] = {.dt = 0.004, .options = {}, .law = TorqueLaw::kExplicit, .armature = 0.5};
  suite.perturbations.push_back(test::perturbation("{actuation: {armature: 0, dt: 0.001}}"));
  const auto experiment = test::experiment_of(suite, {test::paired(Task::kWave, *test::g1())});
  EpisodeSpec spec = test::first_of(*experiment);
  const Scene clean = experiment->scene(spec);
  EXPECT_EQ(clean.dt, 0.004);
  EXPECT_EQ(clean.law, TorqueLaw::kExplicit);
  EXPECT_EQ(clean.robot->joints[0].armature, 0.5 * test::g1()->joints[0].armature);
  spec.perturbation = &experiment->suite().perturbations.back();
  const Scene perturbed = experiment->scene(spec);
  EXPECT_EQ(perturbed.dt, 0.001);
  EXPECT_EQ(perturbed.law, TorqueLaw::kExplicit);
  for (const RobotJoint& joint : perturbed.robot->joints) EXPECT_EQ(joint.armature, 0.0);
  EXPECT_EQ(spec.body->robot->joints[0].armature, test::g1()->joints[0].armature);  // the controller's
}

TEST(Experiment, NoApproachStartsInASolidPartner) {
  Suite suite = test::playback_suite();
  suite.engines = {"mujoco"};
  suite.partner = SuitePartner::kSolid;
  suite.start = SuiteStart::kApproach;
  suite.start_radius = 4.0;
  const auto experiment = test::experiment_of(suite, {test::paired(Task::kWave, *test::g1())});
  int again = 0;
  for (std::uint64_t seed = 0; seed < 600; ++seed) {
    const EpisodeSpec spec = test::first_of(*experiment, seed);
    const RolloutSetup setup = experiment->setup(spec);
    const Scene scene = experiment->scene(spec);
    const HumanJoints partner = partner_joints(episode_partner(setup).joints, 0);
    EXPECT_FALSE(is_in_partner(scene, setup.start, partner)) << seed;
    const AdaptationOptions options{.start = StartMode::kApproach, .start_radius = suite.start_radius};
    const AdaptedMotion first =
        adapt_by_phase(spec.clip->robot, spec.clip->phases, *spec.body->robot, options, spec.seed);
    again += is_in_partner(scene, spec.body->robot->standing_state(first.motion.root.front()), partner);
  }
  EXPECT_GT(again, 0);
}

TEST(Parallel, EveryIndexOnceAndTheFirstExceptionComesBack) {
  std::vector<std::atomic<int>> hits(100);
  parallel_for_each(100, 2, [&](int i) { ++hits[i]; });
  for (const auto& hit : hits) EXPECT_EQ(hit, 1);
  EXPECT_THROW(parallel_for_each(100, 2, [](int i) { require(i != 50, "fifty"); }), std::invalid_argument);
}

// A network that is replaced in the middle of a run: all rows are of the one that was loaded, and so is the digest.
TEST(Runner, AllRowsAreOfTheFilesThatWereLoaded) {
  if (!is_available("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const test::ScratchFolder folder;
  const std::string network = folder / "net.safetensors";
  const auto put = [&](const char* name) {
    write_file(network, read_file(std::string(DUET_SOURCE_DIR "/controllers/wbc_sim/") + name + ".safetensors"));
  };
  const auto rows_of = [&](const std::string& name, const std::string& swapped) {
    put("braced");
    const Suite suite = parse_suite(
        "schema: duet.suite/1\nname: test\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave, bend]\n"
        "engines: [mujoco]\ncontrollers: [{name: w, use: wbc_sim, options: {network: " +
            network +
            "}}]\n"
            "policies: [replay]\nstart: act\n",
        "test.yaml");
    RunOptions options;
    options.stop_asked = [&] {  // asked after the network was loaded, many times an episode
      if (!swapped.empty()) put(swapped.c_str());
      return false;
    };
    run(suite, folder / name, options);
    std::map<std::string, EpisodeRow> rows;
    for (const EpisodeRow& row : load_run(folder / name).rows) rows[row.key] = row;
    return rows;
  };
  const auto untouched = rows_of("untouched", ""), swapped = rows_of("swapped", "student");
  ASSERT_EQ(untouched.size(), 4U);
  ASSERT_EQ(swapped.size(), 4U);
  for (const auto& [key, row] : untouched) {
    ASSERT_TRUE(swapped.contains(key)) << "another digest";
    EXPECT_EQ(swapped.at(key).state_hash, row.state_hash) << row.clip;
    EXPECT_EQ(row.outcome, Outcome::kOk) << row.message;
  }
}

TEST(Runner, AClipThatIsReplacedBetweenItsDigestAndItsUseIsRefused) {
  const test::ScratchFolder folder;
  const std::string clip = folder / "wave.npz";
  save_paired_motion(test::paired(Task::kWave, *test::g1()), clip);
  Suite suite = test::playback_suite();
  suite.clips = {.files = {clip}};
  FileDigests digests;
  digests.add(clip, sha256_hex("what it was"));
  Progress quiet(Progress::Style::kQuiet);
  EXPECT_SENTENCE(
      test::thrown_message<InputError>([&] { prepare_clips(suite, *test::g1(), 1, quiet, {.files = &digests}); }));
}

// A card without what every episode would ask of it is refused before the first one.
TEST(Runner, AsksOfTheCardBeforeTheFirstEpisode) {
  const test::ScratchFolder folder;
  std::filesystem::copy(DUET_SOURCE_DIR "/robots/t1", folder / "t1");
  const std::string card = folder / "t1/t1.yaml", text = read_file(card);
  const auto without = [&](const std::string& begin, const std::string& end) {
    const std::size_t at = text.find(begin);
    write_file(card, text.substr(0, at) + text.substr(text.find(end, at)));
  };
  Suite clips = test::playback_suite();
  clips.robot = card;
  without("tracks:", "# Collision");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { run(clips, folder / "a"); }));
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
  without("keypoints:", "# What the detectors");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { run(clips, folder / "b"); }));
  Suite walk = parse_suite(
      "schema: duet.suite/1\nname: walk\nversion: 1.0.0\nengines: [mujoco]\ncontrollers: [pd]\n"
      "reference: [{velocity: [0, 0, 0], seconds: 0.4}]\n",
      "walk.yaml");
  walk.robot = card;
  if (!is_available("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  without("tracks:", "# Collision");
  EXPECT_EQ(run(walk, folder / "c").outcomes.count("error"), 0U);  // nobody is there to be followed
  write_file(card, [&] {
    std::string soles = text;
    for (std::size_t at = soles.find(", sole: true"); at != std::string::npos; at = soles.find(", sole: true"))
      soles.erase(at, 12);
    return soles;
  }());
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { run(walk, folder / "d"); }));
}

Suite walking_suite(const std::string& controller, const std::string& engine, double seconds) {
  return parse_suite(fmt::format("schema: duet.suite/1\nname: walk\nversion: 1.0.0\nengines: [{}]\ncontrollers: [{}]\n"
                                 "reference: [{{velocity: [0.5, 0, 0], seconds: {}}}]\nrecord: {{trajectories: all}}\n",
                                 engine, controller, seconds),
                     "walk.yaml");
}

// A walker that leaves joints to the reference is led in the pose in which it was made to walk, and begins in it.
TEST(Runner, AWalkerIsLedInItsOwnPosture) {
  const test::ScratchFolder folder;
  register_controller({.name = "armless",
                       .about = "a controller that leaves an elbow alone",
                       .robot = "g1",
                       .walks = true,
                       .options = {},
                       .posture = {{"left_elbow_joint", 0.25}}},
                      [](const std::shared_ptr<const RobotModel>& robot, const ControllerOptions&) {
                        return make_pd_controller(robot);
                      });
  run(walking_suite("armless", "playback", 0.4), folder / "run");
  const std::filesystem::directory_iterator files(folder / "run/trajectories");
  const Recording recording = load_recording(files->path());
  const RobotModel robot = load_robot(shipped_card("g1"));
  EXPECT_EQ(recording.robot[0].q[robot.joint_index("left_elbow_joint")], 0.25);
  EXPECT_EQ(recording.robot[0].q[robot.joint_index("right_elbow_joint")],
            robot.neutral[robot.joint_index("right_elbow_joint")]);
}

// Its arms have to stay near 0: in the robot's neutral pose it falls after 2.5 s.
TEST(Runner, FalconsPrecursorWalksInTheWalkingSuite) {
  const std::string network = test::shared_file("models/falcon/dec_loco_g1_29dof.onnx");
  if (network.empty()) GTEST_SKIP() << "not run: models/falcon/dec_loco_g1_29dof.onnx absent";
  if (!is_available("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const test::ScratchFolder folder;
  Suite walk = walking_suite("falcon_dec_loco", "mujoco", 5.0);
  walk.controllers[0].options["network"] = network;
  EXPECT_EQ(run(walk, folder / "run").outcomes.count("fell"), 0U);
}

TEST(Runner, SaysTheFirstErrorWithItsEpisode) {
  register_controller({"throws", "a controller that always throws", "", false, {}},
                      [](const std::shared_ptr<const RobotModel>&, const ControllerOptions&) {
                        struct Throws final : Controller {
                          [[nodiscard]] std::string_view name() const override { return "throws"; }
                          void reset(const RobotState&) override { throw std::runtime_error("no such gain"); }
                          void act(const RobotState&, const Reference&, JointCommand&) override {}
                        };
                        return std::make_unique<Throws>();
                      });
  if (!is_available("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const test::ScratchFolder folder;
  const Suite suite = parse_suite(
      "schema: duet.suite/1\nname: test\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
      "engines: [mujoco]\ncontrollers: [throws]\npolicies: [replay]\nstart: act\n",
      "test.yaml");
  const RunSummary summary = run(suite, folder / "run");
  EXPECT_EQ(summary.outcomes.at("error"), 2);
  EXPECT_SENTENCE(errors_sentence(2, summary.first_error));
}

}  // namespace
}  // namespace duet
