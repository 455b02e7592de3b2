// docs/trust.md says for each file of a run, a plan and an attempt what it can make duet do. Here a stranger plants a
// program, a path and a link in each of them: nothing runs, nothing outside is read into a result, written or deleted.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <regex>
#include <sstream>
#include <utility>

#include "duet/cluster/merge.h"
#include "duet/cluster/plan_run.h"
#include "duet/cluster/run_status.h"
#include "duet/cluster/work_shard.h"
#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/share.h"
#include "duet/execution/report_content.h"
#include "duet/execution/run_inputs.h"
#include "duet/execution/verification.h"
#include "duet/rows/folder/run_directory.h"
#include "duet/rows/json_fields.h"
#include "tests/app/program.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using test::duet_program;
using testing::HasSubstr;
using testing::IsEmpty;

// A row of the table "Files of a run, a plan and an attempt".
struct TableRow {
  std::vector<std::string> patterns;
  std::string meaning;
};

std::vector<TableRow> trust_table() {
  std::istringstream text(read_file(DUET_SOURCE_DIR "/docs/trust.md"));
  std::vector<TableRow> rows;
  bool inside_section = false;
  for (std::string line; std::getline(text, line);) {
    if (line.starts_with("## ")) inside_section = line == "## Files of a run, a plan and an attempt";
    if (!inside_section || !line.starts_with("| `")) continue;
    const std::size_t end = line.find(" | ");
    TableRow& row = rows.emplace_back();
    row.meaning = line.substr(end + 3);
    const std::regex pattern("`([^`]+)`");
    const std::string cell = line.substr(0, end);
    for (std::sregex_iterator found(cell.begin(), cell.end(), pattern), last; found != last; ++found)
      row.patterns.push_back((*found)[1]);
  }
  return rows;
}

// '*' within a name, '**' through folders.
bool fits(const std::string& pattern, const std::string& name) {
  std::string expression;
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    const bool deep = pattern.compare(i, 2, "**") == 0;
    if (pattern[i] == '*') expression += deep ? ".*" : "[^/]*";
    if (pattern[i] == '.') expression += "\\.";
    if (pattern[i] != '*' && pattern[i] != '.') expression += pattern[i];
    i += deep ? 1 : 0;
  }
  return std::regex_match(name, std::regex(expression));
}

const TableRow* row_of(const std::vector<TableRow>& table, const std::string& name) {
  for (const TableRow& row : table)
    for (const std::string& pattern : row.patterns)
      if (fits(pattern, name)) return &row;
  return nullptr;
}

std::vector<std::string> files_below(const std::string& folder) {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    if (!entry.is_directory()) names.push_back(entry.path().lexically_relative(folder).generic_string());
  std::ranges::sort(names);
  return names;
}

// A page is no data and refused by read_file; here any file is only bytes.
std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Runs of every kind, made once by the program.
class TrustTable : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    world_ = new test::ScratchFolder();
    save_paired_motion(test::paired(Task::kWave, *test::g1()), *world_ / "here/wave.npz");
    fs::copy(share_file("limits", "metrics/limits/iso_ts_15066.yaml"), *world_ / "here/limits.yaml");
    write_file(*world_ / "here/suite.yaml",
               "schema: duet.suite/1\nname: trusted\nversion: 1.0.0\nclips: {files: [wave.npz]}\ntasks: [wave]\n"
               "engines: [playback]\ncontrollers: [pd]\npolicies: [replay]\nstart: clip\npartner: solid\n"
               "contact_limits: limits.yaml\nrecord: {trajectories: all}\n");
    write_file(*world_ / "here/arms.yaml",
               "schema: duet.trainings/1\ntrain: wbc\narguments: [--stage, stand, --steps, '64', --environments, '4', "
               "--threads, '1']\narms: {plain: []}\nseeds: [1]\n");
    const std::string suite = *world_ / "here/suite.yaml", run = *world_ / "run", planned = *world_ / "planned",
                      trainings = *world_ / "trainings";
    // In this process, which has another digest than the program.
    StopToken stop;
    Progress quiet(Progress::Style::kQuiet);
    PlanOptions options;
    options.costs = {{"playback/pd", 0.01}};
    plan_run(load_suite(suite), planned, options, stop, quiet);
    work_shard(planned, 0, {}, stop, quiet);
    for (const std::string& command :
         {"run -q " + suite + " -o " + run, "run -q " + suite + " -o " + run,
          "publish -q " + run + " -o " + (*world_ / "published"),
          "report -q --no-clips -f md,csv,json,tex,html,sqlite " + run, "merge -q " + planned,
          "plan -q --trainings " + (*world_ / "here/arms.yaml") + " -o " + trainings,
          "submit --allow-programs " + trainings, "work -q --allow-programs --shard 0 " + trainings}) {
      const test::Answer answer = duet_program(command);
      ASSERT_EQ(answer.code, 0) << command << answer.err;
    }
  }
  static void TearDownTestSuite() { delete world_; }

  TrustTable() {
    write_file(outside_ / "secret.txt", "SECRET-4711\n");
    write_file(outside_ / "evil.yaml",
               "schema: duet.policy/1\nname: evil\nkind: process\ncommand: [/bin/sh, -c, 'touch " + ran() +
                   "']\noutput: {anchors: 5, spacing: 0.2, frame: world}\n");
    write_file(outside_ / "precious/file", "mine");
  }

  [[nodiscard]] std::string ran() const { return scratch_ / "RAN"; }
  // The files outside, each with its content.
  [[nodiscard]] std::map<std::string, std::string> outside() const {
    std::map<std::string, std::string> files;
    for (const std::string& name : files_below(outside_ / ".")) files[name] = bytes_of(outside_ / name);
    return files;
  }
  // A copy of one of the runs.
  std::string copy_of(const std::string& name) {
    const std::string copy = scratch_ / name;
    fs::remove_all(copy);
    fs::copy(*world_ / name, copy, fs::copy_options::recursive);
    return copy;
  }
  // Texts that a stranger would write into a field.
  [[nodiscard]] std::vector<std::string> plants() const {
    const std::string touch = "touch " + ran();
    return {"$(" + touch + ")`" + touch + "`'; " + touch + " #\n" + touch, outside_ / "secret.txt",
            fs::path(outside_ / "secret.txt").lexically_relative(scratch_ / "run").string(), outside_ / "evil.yaml"};
  }

  // Every command that opens such a folder, in this process; each may refuse. How many did not.
  int use(const std::string& folder, bool episodes) {
    const std::string out = scratch_ / "out";
    int done = 0;
    const auto attempt = [&](const std::function<void()>& action) {
      try {
        action();
        ++done;
      } catch (const std::exception&) {
        return;
      }
    };
    if (fs::exists(folder + "/plan.json")) use_plan(folder, out, episodes, attempt);
    if (fs::exists(folder + "/run.json")) use_run(folder, out, episodes, attempt);
    return done;
  }

  void use_plan(const std::string& folder, const std::string& out, bool episodes,
                const std::function<void(const std::function<void()>&)>& attempt) {
    attempt([&] {
      const RunStatus status = run_status(folder);
      write_file(out + "/status.txt", status_text(status) + dumped(status_json(status)));
    });
    attempt([&] {
      RunStatus status = run_status(folder);
      for (ShardStatus& shard : status.shards) shard.state = ShardState::kWaiting;
      SlurmOptions options;
      options.program = {"true"};
      const SlurmJobs jobs = slurm_jobs(status, folder, options);
      write_slurm_scripts(jobs, folder);
      write_file(out + "/array.sh", jobs.array_script);
      if (std::exchange(script_, jobs.array_script) == jobs.array_script) return;
      static_cast<void>(!std::system(("SLURM_ARRAY_TASK_ID=0 bash " + out + "/array.sh >/dev/null 2>&1").c_str()));
    });
    if (episodes)
      attempt([&] {
        fs::remove_all(folder + "/attempts");
        work_shard(folder, 0, {}, stop_, quiet_);
      });
  }

  void use_run(const std::string& folder, const std::string& out, bool episodes,
               const std::function<void(const std::function<void()>&)>& attempt) {
    attempt([&] {
      const duet::Run run = load_run(folder);
      const RunTables tables = tables_of(run.rows, run);
      const std::vector<Analysis> analyses = run_analyses(tables);
      for (const auto& [name, text] : analysis_files(analyses, "md"))
        write_file(join_without_links(folder, name), text);
      for (const auto& [name, text] : analysis_files(analyses, "csv")) write_file(out + "/" + name, text);
      write_file(out + "/report.html",
                 html_report(report_content(run, tables, analyses, {}, episodes, {}, 1, quiet_), {}));
    });
    attempt([&] { publish_run(folder, out + "/published", published_inputs(folder, false)); });
    attempt([&] { merge_runs({folder}, {.output = out + "/merged"}); });
    if (episodes) attempt([&] { verify_run(load_run(folder), {.episodes = 1}, quiet_); });
  }

  // After a command: nothing has run, nothing outside is another than before, nothing of it stands in a result.
  void expect_harmless(const std::map<std::string, std::string>& before, const std::string& what) {
    EXPECT_FALSE(fs::exists(ran())) << what;
    EXPECT_EQ(outside(), before) << what;
    if (fs::exists(scratch_ / "out")) {
      for (const std::string& name : files_below(scratch_ / "out"))
        EXPECT_EQ(bytes_of(scratch_ / ("out/" + name)).find("SECRET-4711"), std::string::npos) << what << name;
    }
    fs::remove_all(scratch_ / "out");
  }

  static test::ScratchFolder* world_;
  test::ScratchFolder scratch_, outside_;
  std::string script_;  // that was run last
  StopToken stop_;
  Progress quiet_{Progress::Style::kQuiet};
};
test::ScratchFolder* TrustTable::world_ = nullptr;

TEST_F(TrustTable, HasARowForEveryFileThatDuetWrites) {
  const std::vector<TableRow> table = trust_table();
  ASSERT_GT(table.size(), 20U);
  for (const char* folder : {"run", "published", "planned", "trainings"})
    for (const std::string& name : files_below(*world_ / folder))
      EXPECT_NE(row_of(table, name), nullptr) << "docs/trust.md has no row for " << folder << "/" << name;
}

TEST_F(TrustTable, EveryFileThatARunKeepsHasARow) {
  const std::string examples = std::string(DUET_SOURCE_DIR) + "/examples/policies/";
  const Suite suite = load_suite(*world_ / "here/suite.yaml", {{"policies", "['" + examples + "wave_policy.yaml']"}});
  keep_inputs(archive_inputs(suite, scratch_ / "kept"), scratch_ / "kept");
  const std::vector<TableRow> table = trust_table();
  for (const std::string& name : files_below(scratch_ / "kept")) EXPECT_NE(row_of(table, name), nullptr) << name;
}

// Without a stranger every command does its work: what follows is refused for what was planted.
TEST_F(TrustTable, CommandsDoTheirWorkWhereNothingIsPlanted) {
  EXPECT_EQ(use(copy_of("run"), true), 4);
  fs::remove_all(scratch_ / "out");
  EXPECT_EQ(use(copy_of("published"), true), 4);
  fs::remove_all(scratch_ / "out");
  EXPECT_EQ(use(copy_of("planned"), true), 7);
  fs::remove_all(scratch_ / "out");
  EXPECT_EQ(use(copy_of("trainings"), false), 2);
}

// A file that no command reads, by its row of the table, may be a link: nobody follows it. All else is refused.
TEST_F(TrustTable, ALinkInThePlaceOfAFileIsNotFollowed) {
  const std::vector<TableRow> table = trust_table();
  for (const std::string folder : {"run", "published", "planned", "trainings"}) {
    const std::string copy = copy_of(folder);
    for (const std::string& name : files_below(copy)) {
      const std::string file = copy + "/" + name, kept = bytes_of(file);
      write_file(outside_ / "linked", kept);
      fs::remove(file);
      fs::create_symlink(outside_ / "linked", file);
      const auto before = outside();
      const int done = use(copy, false);
      const bool is_read = !row_of(table, name)->meaning.starts_with("nothing");
      EXPECT_TRUE(done == 0 || !is_read) << folder << "/" << name;
      expect_harmless(before, folder + "/" + name);
      fs::remove(file);
      write_file(file, kept);
    }
  }
}

// The same of folders: what is in them is elsewhere.
TEST_F(TrustTable, ALinkInThePlaceOfAFolderIsNotFollowed) {
  for (const std::string folder : {"run", "published", "planned", "trainings"}) {
    const std::string copy = copy_of(folder);
    std::vector<fs::path> folders;
    for (const fs::directory_entry& entry : fs::directory_iterator(copy))
      if (entry.is_directory()) folders.push_back(entry.path());
    for (const fs::path& path : folders) {
      fs::rename(path, outside_ / "folder");
      fs::create_directory_symlink(outside_ / "folder", path);
      const auto before = outside();
      EXPECT_EQ(use(copy, false), 0) << path;
      expect_harmless(before, path.string());
      fs::remove(path);
      fs::rename(outside_ / "folder", path);
    }
  }
}

// Places of a document's values: in a list the first two, in an object of numbers, such as metrics, the first
// three.
std::vector<nlohmann::json::json_pointer> fields_of(
    const nlohmann::json& json, const nlohmann::json::json_pointer& at = nlohmann::json::json_pointer()) {
  constexpr std::size_t kAll = 1000, kNumbers = 3, kItems = 2;
  if (!json.is_structured()) return {at};
  const bool numbers = std::ranges::all_of(json, [](const nlohmann::json& value) { return value.is_number(); });
  std::vector<nlohmann::json::json_pointer> fields;
  std::size_t count = 0;
  for (const auto& [name, value] : json.items()) {
    if (++count > (json.is_array() ? kItems : numbers ? kNumbers : kAll)) break;
    const auto below = json.is_array() ? at / (count - 1) : at / name;
    for (auto& field : fields_of(value, below)) fields.push_back(std::move(field));
  }
  return fields;
}

// With its key made anew, so that a reader comes to the other fields.
std::string row_line(nlohmann::json json) {
  try {
    const EpisodeRow row = row_from_json(json);
    json["key"] = episode_key(row);
  } catch (const std::exception&) {
  }
  return dumped(json);
}

TEST_F(TrustTable, AFieldOfAJsonFileMakesNothingRunAndNamesNothingOutside) {
  const std::vector<TableRow> table = trust_table();
  int planted = 0, fields = 0;
  for (const std::string folder : {"run", "planned", "trainings", "published"}) {
    const std::string copy = copy_of(folder);
    for (const std::string& name : files_below(copy)) {
      const bool rows = name.ends_with("s.jsonl") || (name.starts_with("attempts/") && name.ends_with(".jsonl"));
      const bool lines = rows || name.ends_with(".log") || name.ends_with(".jsonl");
      const bool is_read = !row_of(table, name)->meaning.starts_with("nothing");
      if (!is_read || (!lines && !name.ends_with(".json"))) continue;
      if (folder == "published" && name != "manifest.json") continue;              // which holds all others
      if (folder == "planned" && fs::exists(*world_ / ("run/" + name))) continue;  // read as there
      const std::string file = copy + "/" + name, kept = bytes_of(file);
      const std::size_t end = lines ? kept.find('\n') : kept.size();
      const nlohmann::json honest = nlohmann::json::parse(kept.substr(0, end));
      const bool episodes = name == "run.json" || name == "plan.json" || name == "inputs/inputs.json";
      const bool names_files = episodes || name == "manifest.json";
      const std::vector<std::string> texts =
          names_files ? plants() : std::vector<std::string>{plants()[0] + " " + plants()[1]};
      const auto before = outside();
      for (const auto& field : fields_of(honest)) {
        ++fields;
        for (const std::string& plant : texts) {
          nlohmann::json json = honest;
          if (!json[field].is_string() && plant != texts.front()) continue;  // the type alone refuses it
          json[field] = plant;
          write_file(file, (rows ? row_line(json) : dumped(json)) + kept.substr(end), Durability::kUnsynced);
          use(copy, episodes);
          expect_harmless(before, folder + "/" + name + field.to_string());
          ++planted;
        }
      }
      write_file(file, kept);
    }
  }
  EXPECT_GT(fields, 150);
  EXPECT_GT(planted, 250);
}

// Words of a journal are no JSON.
TEST_F(TrustTable, AWordOfAJournalMakesNothingRun) {
  const std::string copy = copy_of("planned");
  const auto before = outside();
  for (const std::string& name : files_below(copy)) {
    if (!name.ends_with(".log")) continue;
    const std::string kept = bytes_of(copy + "/" + name);
    for (const std::string& plant : plants())
      for (const char* word : {"began", "did", "crashed", "ended"}) {
        write_file(copy + "/" + name, kept + word + " " + plant + "\n" + word + " " + plant + " " + plant + " 1.0\n");
        use(copy, false);
        try {
          work_shard(copy, 0, {}, stop_, quiet_);
        } catch (const std::exception&) {
        }
        expect_harmless(before, name + word);
      }
  }
}

// Places of the scalars of a YAML document, and what sets them.
void each_scalar(YAML::Node node, const std::function<void(YAML::Node)>& visit) {
  if (node.IsScalar()) return visit(node);
  if (node.IsMap())
    for (const auto& entry : node) each_scalar(entry.second, visit);
  if (node.IsSequence())
    for (const YAML::Node& item : node) each_scalar(item, visit);
}

TEST_F(TrustTable, AFieldOfASuiteMakesNothingRunAndShowsNothingOutside) {
  int planted = 0;
  for (const std::string folder : {"run", "planned"}) {
    const std::string copy = copy_of(folder), file = copy + "/suite.yaml", kept = bytes_of(file);
    const auto before = outside();
    YAML::Node document = YAML::Load(kept);
    each_scalar(document, [&](YAML::Node node) {
      const std::string honest = node.Scalar();
      for (const std::string& plant : plants()) {
        node = plant;
        write_file(file, YAML::Dump(document) + "\n", Durability::kUnsynced);
        use(copy, true);
        expect_harmless(before, folder + " suite.yaml " + honest + " -> " + plant);
        ++planted;
      }
      node = honest;
    });
    write_file(file, kept);
  }
  EXPECT_GT(planted, 200);
}

// A clip of mine that somebody names in the place of his own is in no page of his run.
TEST_F(TrustTable, AClipOutsideIsNotShown) {
  const std::string copy = copy_of("run");
  save_paired_motion(test::paired(Task::kBend, *test::g1()), outside_ / "mine.npz");
  std::string suite = read_file(copy + "/suite.yaml");
  const std::size_t at = suite.find("inputs/clips/0000_wave.npz");
  ASSERT_NE(at, std::string::npos);
  write_file(copy + "/suite.yaml", suite.replace(at, 26, outside_ / "mine.npz"));
  EXPECT_THAT(test::thrown_message<InputError>([&] { suite_of_head(load_run(copy)); }),
              HasSubstr("clips: expected the file"));
}

// Only what was made is deleted: a folder of the user's that is called as a half-made one was stays.
TEST_F(TrustTable, FoldersBesideAResultStay) {
  const std::string copy = copy_of("run");
  for (const char* name : {"out.partial/precious", "out.part/precious", "out.partial.rows/precious"})
    write_file(scratch_ / name, "mine");
  EXPECT_EQ(duet_program("publish -q " + copy + " -o " + (scratch_ / "out")).code, 0);
  fs::remove_all(scratch_ / "out");
  EXPECT_EQ(duet_program("merge -q " + copy + " -o " + (scratch_ / "out")).code, 0);
  for (const char* name : {"out.partial/precious", "out.part/precious", "out.partial.rows/precious"})
    EXPECT_EQ(read_file(scratch_ / name), "mine");
  for (const fs::directory_entry& entry : fs::directory_iterator(scratch_ / "."))
    EXPECT_THAT(entry.path().filename().string(),
                testing::AnyOf("run", "out", "out.partial", "out.part", "out.partial.rows"));
}

}  // namespace
}  // namespace duet
