// Files that a run leaves behind and those made from it: run directories, published or not, baselines, training curves.
#include <filesystem>
#include <nlohmann/json.hpp>

#include "duet/core/digest.h"
#include "duet/report/page/training_curves.h"
#include "duet/report/ranking/golden.h"
#include "duet/report/ranking/leaderboard.h"
#include "duet/rows/folder/run_directory.h"
#include "duet/rows/row_file.h"
#include "tests/fuzz/reader.h"
#include "tests/rows/rows.h"

namespace duet::fuzz {
namespace {

const char* const kFiles[] = {"run.json", "env.json", "episodes.jsonl", "suite.yaml"};

std::string text_of(const nlohmann::json& json) { return json.dump() + "\n"; }

// run.json, env.json, episodes.jsonl, suite.yaml.
std::string run_sample(unsigned /*seed*/) {
  const RunInfo info = test::tiny_run();
  const std::string folder = scratch_folder() + "/good";
  std::filesystem::remove_all(folder);
  RunDirectory run = RunDirectory::open(folder, info);
  for (int i = 0; i < 2; ++i) run.append(test::episode("replay", "hug", i, i == 0));
  std::string sample;
  for (const char* file : kFiles)
    sample += (sample.empty() ? "" : std::string(kSeparator)) + read_file(folder + "/" + file);
  return sample;
}

// The folder of a run whose files are the parts of `bytes`.
std::string run_folder(std::string_view bytes) {
  const std::string folder = scratch_folder() + "/run";
  std::filesystem::create_directories(folder);
  const std::vector<std::string_view> texts = parts(bytes, std::size(kFiles));
  for (std::size_t i = 0; i < texts.size(); ++i) scratch_file(std::string("run/") + kFiles[i], texts[i]);
  std::filesystem::remove(folder + "/manifest.json");
  return folder;
}

void read_run(std::string_view bytes) {
  const Run run = load_run(run_folder(bytes));
  (void)analysis_markdown(leaderboard_analysis(leaderboard(run.rows)));
}

// A manifest that fits the run of run_sample.
std::string manifest_sample(unsigned seed) {
  (void)run_sample(seed);
  nlohmann::json files;
  for (const char* file : kFiles) files[file] = sha256_file(scratch_folder() + "/good/" + file);
  return text_of({{"schema", "duet.published/1"},
                  {"suite", "tiny"},
                  {"suite_version", "1.0.0"},
                  {"suite_hash", "0123456789abcdef"},
                  {"rows", 2},
                  {"without", {"trace", "feet"}},
                  {"files", files}});
}

void read_manifest(std::string_view bytes) {
  static const std::string folder = run_folder(run_sample(0));
  scratch_file("run/manifest.json", bytes);
  check_published(folder);
}

std::vector<LeaderboardEntry> entries() {
  return leaderboard({test::episode("replay", "hug", 0, true), test::episode("replay", "hug", 1, false)});
}

std::string golden_sample(unsigned /*seed*/) { return bless(entries(), test::tiny_run()); }

void read_golden(std::string_view bytes) { (void)check(std::string(bytes), entries(), test::tiny_run()); }

std::string curves_sample(unsigned /*seed*/) { return "steps,return,loss\n0,1,0.5\n100,3,\n200,-4e1,nan\n"; }

void read_curves(std::string_view bytes) { (void)parse_curves(bytes, "fuzz.csv"); }

std::string row_sample(unsigned seed) {
  return to_json(test::episode("replay", "hug", static_cast<int>(seed), true)).dump();
}

void scan_one_row(std::string_view bytes) { (void)scan_row(bytes); }

}  // namespace

std::vector<Reader> result_readers() {
  return {{"run_directory", run_sample, read_run},
          {"manifest", manifest_sample, read_manifest},
          {"golden", golden_sample, read_golden},
          {"row_scan", row_sample, scan_one_row},
          {"training_curves", curves_sample, read_curves}};
}

}  // namespace duet::fuzz
