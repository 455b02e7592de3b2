// Inputs of a benchmark: suites, profiles of engines, limits of contacts, certificates of parity.
#include <nlohmann/json.hpp>

#include "duet/app/certificate.h"
#include "duet/cluster/attempt.h"
#include "duet/cluster/shard_plan.h"
#include "duet/cluster/work_shard.h"
#include "duet/core/file.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/suite/profile.h"
#include "duet/experiment/suite/suite.h"
#include "duet/metrics/contact_limits.h"
#include "duet/robots/yaml_section.h"
#include "tests/fuzz/reader.h"

namespace duet::fuzz {
namespace {

constexpr const char* kSuite = R"(schema: duet.suite/1
name: sample
version: 1.0.0
seed: 7
clips: {synth: {per_task: 2, seed: 42}, pad: {before: 1, after: 0.5}}
tasks: [hug, handshake]
engines: [playback]
controllers: [pd]
policies: [replay]
episodes_per_clip: 2
start: act
max_root_speed: 0.6
detector: {version: robot, thresholds: paper}
limits: {wall_s_per_episode: 60}
)";

std::string suite_sample(unsigned seed) {
  constexpr const char* kNames[] = {"core", "contact", "perception", "waist", "partner", "spatial"};
  if (seed / 64 % 2 == 0) return kSuite;
  return read_file(std::string(DUET_SOURCE_DIR "/suites/") + kNames[seed / 128 % std::size(kNames)] + ".yaml");
}

// Clips of the suite's tasks in a robot's place, without motion: the plan only counts and names them.
std::vector<PairedMotion> clips_of(const Suite& suite) {
  std::vector<PairedMotion> clips;
  for (const Task task : suite.tasks) {
    for (const char* id : {"a", "b"}) {
      clips.emplace_back();
      clips.back().clip_id = id;
      clips.back().task = task;
    }
  }
  return clips;
}

// A plan of this many episodes takes below a second; suites of more are for the reader alone.
bool is_small(const Suite& suite) {
  constexpr double kMostEpisodes = 100'000;
  double episodes = suite.episodes_per_clip;
  for (const std::size_t count : {2 * suite.tasks.size(), suite.engines.size(), suite.controllers.size(),
                                  suite.policies.size() + 1, suite.perturbations.size()})
    episodes *= static_cast<double>(std::max<std::size_t>(count, 1));
  return episodes <= kMostEpisodes;
}

void plan(const Suite& suite) {
  if (!suite.robot.empty() || !is_small(suite)) return;
  std::vector<std::string> controllers, policies;
  for (const SuiteController& controller : suite.controllers) controllers.push_back(controller.name);
  for (const SuitePolicy& policy : suite.policies) policies.push_back(policy.name);
  Embodiments bodies(suite, controllers, policies);
  bodies.take_clips(clips_of(suite));
  const EpisodePlan planned(suite, bodies);
  for (std::int64_t i = 0; i < planned.size(); ++i) (void)planned.at(i);
}

void read_suite(std::string_view bytes) {
  const Suite suite = parse_suite(std::string(bytes), "fuzz.yaml");
  (void)parse_suite(resolved_yaml(suite), "resolved.yaml");  // what was read can be written
  plan(suite);
}

std::string profile_sample(unsigned seed) {
  constexpr const char* kNames[] = {"parity", "fast", "accurate"};
  return read_file(std::string(DUET_SOURCE_DIR "/profiles/") + kNames[seed / 64 % std::size(kNames)] + ".yaml");
}

void read_profile_file(std::string_view bytes) { (void)load_profile(scratch_file("fuzz.yaml", bytes)); }

std::string limits_sample(unsigned /*seed*/) { return read_file(DUET_SOURCE_DIR "/metrics/limits/iso_ts_15066.yaml"); }

void read_limits(std::string_view bytes) { (void)parse_contact_limits(std::string(bytes), "fuzz.yaml"); }

std::string certificate_sample(unsigned /*seed*/) {
  return certificate_json(certify({}, "parity", "2026-01-02T03:04:05Z")).dump();
}

void read_certificate(std::string_view bytes) { (void)load_certificate(scratch_file("fuzz.json", bytes)); }

constexpr const char* kPlan = R"({"schema": "duet.plan/1", "kind": "episodes", "program": {"duet": "aa", "ode": "bb"},
 "suite_hash": "cc", "episodes": 4, "costs": {"ode/vmc": 0.25},
 "clips": [{"task": "wave", "id": "wave-000", "file": "clips/000000.npz", "sha256": "dd"}],
 "shards": [{"name": "ode", "begin": 0, "end": 2, "cost_s": 1.5, "keys": "ee"},
            {"name": "ode", "begin": 2, "end": 4, "cost_s": 1.5, "keys": "ff"}]}
)";
constexpr const char* kTrainingPlan = R"({"schema": "duet.plan/1", "kind": "trainings", "program": {"duet": "aa"},
 "suite_hash": "", "episodes": 1, "costs": {}, "clips": [],
 "shards": [{"name": "plain-1", "begin": 0, "end": 1, "cost_s": 600, "train": "wbc", "arm": "plain", "seed": 1, "options": {}}]}
)";

std::string plan_sample(unsigned seed) { return seed / 64 % 2 == 0 ? kPlan : kTrainingPlan; }

void read_plan(std::string_view bytes) {
  (void)scratch_file("plan.json", bytes);
  (void)read_shard_plan(scratch_folder());
}

std::string journal_sample(unsigned seed) {
  std::string text =
      "{\"schema\":\"duet.attempt/1\",\"shard\":3,\"node\":\"n1\",\"pid\":4711,\"plan\":\"aa\",\"started_at\":"
      "\"2026-01-02T03:04:05Z\",\"environment\":{\"machine\":\"m\"}}\nbegan k1\ndid k1 ok 0.250\nbegan k2\n";
  return text + (seed / 64 % 2 == 0 ? "ended stopped\n" : "\ncrashed k2 SIGSEGV\n");
}

void read_journal(std::string_view bytes) { (void)parse_journal(bytes, "fuzz.log"); }

std::string trainings_sample(unsigned /*seed*/) {
  return "schema: duet.trainings/1\ntrain: wbc\narguments: [--steps, '64']\narms: {plain: [], other: [--card, g1]}\n"
         "seeds: [1, 2]\nminutes: 30\n";
}

void read_trainings(std::string_view bytes) { (void)parse_trainings(std::string(bytes), "fuzz.yaml"); }

}  // namespace

std::vector<Reader> bench_readers() {
  return {{"suite", suite_sample, read_suite},
          {"engine_profile", profile_sample, read_profile_file},
          {"contact_limits", limits_sample, read_limits},
          {"certificate", certificate_sample, read_certificate},
          {"shard_plan", plan_sample, read_plan},
          {"attempt_journal", journal_sample, read_journal},
          {"trainings", trainings_sample, read_trainings}};
}

}  // namespace duet::fuzz
