// What a benchmark is told: suites, profiles of engines, limits of contacts, certificates of parity.
#include <nlohmann/json.hpp>

#include "duet/bench/certificate.h"
#include "duet/bench/episode.h"
#include "duet/bench/profile.h"
#include "duet/bench/suite.h"
#include "duet/core/file.h"
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
  Bodies bodies(suite, controllers, policies);
  bodies.take_clips(clips_of(suite));
  (void)plan_episodes(suite, bodies);
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

}  // namespace

std::vector<Reader> bench_readers() {
  return {{"suite", suite_sample, read_suite},
          {"engine_profile", profile_sample, read_profile_file},
          {"contact_limits", limits_sample, read_limits},
          {"certificate", certificate_sample, read_certificate}};
}

}  // namespace duet::fuzz
