// Runs of suites, and what they left.
#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>

#include "duet/backends/engine_module.h"
#include "duet/core/machine.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/execution/missing_tags.h"
#include "duet/execution/report_content.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/experiment/plan/shipped_suites.h"
#include "duet/experiment/suite_file/suite_actors.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/plan_queue.h"
#include "duet/python/bindings.h"
#include "duet/report/page/run_analyses.h"
#include "duet/report/ranking/comparison.h"
#include "duet/report/ranking/leaderboard_rows.h"
#include "duet/rows/json_fields.h"

namespace duet::python {
namespace {

// A policy as evaluate() names it; with a queue, it is a function that is called.
struct AskedPolicy {
  std::string name, use;
  std::map<std::string, std::string> options;
  std::shared_ptr<PlanQueue> queue;  // with the thread that answers
};

// A function goes on with rows of its own alone.
void require_same_function(const SuitePolicy& policy, const std::string& directory) {
  const std::string path = (std::filesystem::path(directory) / "run.json").string();
  if (!std::filesystem::exists(path)) return;
  const std::map<std::string, std::string> there = read_run_json(path).policies;
  const auto found = there.find(policy.name);
  if (found == there.end() || found->second == identity_of(policy).digest) return;
  throw InputError(
      fmt::format("'{}' holds a run of another policy '{}': its code or its data were other ones. Give another folder "
                  "(output=...), or replace=True to put new rows in the place of the old ones; a policy that changes "
                  "its own data while it is called stays one policy with version='...' from its first run on",
                  directory, policy.name));
}

// Those that the suite does not have are added to it; the filter is the run's choice, as `duet run --policies`.
void add_policies(const std::vector<AskedPolicy>& asked, const std::string& directory, bool replace, Suite& suite,
                  RunOptions& options) {
  for (const AskedPolicy& policy : asked) {
    const std::vector<std::string> known = suite.policy_names();
    const bool there = std::ranges::find(known, policy.name) != known.end() || policy.name == kNullPolicy;
    if (!there || !policy.options.empty()) {
      require(!there, "policy '{}' is the suite's own: expected another name for the function", policy.name);
      require(is_plain_name(policy.name), plain_name_message(policy.name));
      SuitePolicy added{.name = policy.name, .use = policy.use, .options = policy.options};
      check_options_of(added);
      if (policy.queue) {
        if (!replace) require_same_function(added, directory);
        if (replace) options.replaced.push_back(policy.name);
        options.called[policy.name] = [queue = policy.queue](const std::shared_ptr<const RobotModel>& robot,
                                                             const PolicyOptions&) { return queue->maker(robot); };
      }
      suite.policies.push_back(std::move(added));
    }
    options.policies.push_back(policy.name);
  }
}

struct SuiteQuestion {
  std::string suite;
  Overrides overrides;
  std::vector<std::string> clips;
  bool allow_programs = false;
};

Suite suite_of(const SuiteQuestion& asked) {
  Suite suite = load_suite(suite_file(asked.suite), asked.overrides);
  suite.allow_programs = asked.allow_programs;
  use_clips(asked.clips, suite);
  suite.require_clips();
  return suite;
}

nlohmann::json summary_json(const RunSummary& summary) {
  nlohmann::json absent = nlohmann::json::object();
  for (const auto* names : {&summary.absent_engines, &summary.absent_controllers, &summary.absent_policies})
    for (const auto& [name, reason] : *names) absent[name] = reason;
  return {{"planned", summary.planned},   {"already_there", summary.already_there},
          {"there_of", summary.there_of}, {"run_now", summary.run},
          {"outcomes", summary.outcomes}, {"absent", absent},
          {"warnings", summary.warnings}, {"complete", summary.end == RunEnd::kComplete}};
}

// A run under way, on a thread of its own.
class Evaluation {
 public:
  Evaluation(Suite suite, std::string output, RunOptions options, bool quiet)
      : options_(std::move(options)), progress_(quiet ? Progress::Style::kQuiet : Progress::Style::kAuto) {
    options_.stop_asked = [this] { return stop_.load(); };
    thread_ = std::thread(
        [this, suite = std::move(suite), output = std::move(output)]() mutable { run(std::move(suite), output); });
  }
  ~Evaluation() {
    const py::gil_scoped_release released;  // a policy that is under way needs it to end
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  Evaluation(const Evaluation&) = delete;
  Evaluation& operator=(const Evaluation&) = delete;

  bool wait(double seconds) {
    const py::gil_scoped_release released;
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return over_; });
  }
  void stop() { stop_ = true; }
  std::string result() {
    const std::lock_guard lock(mutex_);
    require(over_, "the run goes on");
    if (error_) std::rethrow_exception(error_);
    return dumped(summary_json(summary_));
  }

 private:
  void run(Suite suite, const std::string& output) {
    try {
      summary_ = run_suite(std::move(suite), output, options_, progress_);
    } catch (...) {
      error_ = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    over_ = true;
    changed_.notify_all();
  }

  RunOptions options_;
  Progress progress_;
  RunSummary summary_;
  std::exception_ptr error_;
  std::atomic<bool> stop_{false};
  std::mutex mutex_;
  std::condition_variable changed_;
  bool over_ = false;
  std::thread thread_;
};

using PolicyTuple =
    std::tuple<std::string, std::string, std::map<std::string, std::string>, std::shared_ptr<PlanQueue>>;

std::unique_ptr<Evaluation> start(const SuiteQuestion& question, const std::vector<PolicyTuple>& policies,
                                  const std::map<std::string, std::vector<std::string>>& only,
                                  const std::string& output, int jobs, bool retry_errors, bool replace, bool quiet,
                                  const std::vector<std::string>& argv) {
  require(jobs >= 1 && jobs <= 1024, "jobs: expected 1 to 1024, found {}", jobs);
  Suite suite = suite_of(question);
  RunOptions options;
  options.threads = jobs;
  options.retry_errors = retry_errors;
  options.argv = argv;
  const auto chosen_of = [&](const char* kind) {
    return only.contains(kind) ? only.at(kind) : std::vector<std::string>();
  };
  options.engines = chosen_of("engines");
  options.controllers = chosen_of("controllers");
  options.tasks = chosen_of("tasks");
  options.perturbations = chosen_of("perturbations");
  std::vector<AskedPolicy> asked;
  for (const auto& [name, use, settings, queue] : policies) asked.push_back({name, use, settings, queue});
  add_policies(asked, output, replace, suite, options);
  return std::make_unique<Evaluation>(std::move(suite), output, std::move(options), quiet);
}

struct TablePair {
  std::string markdown, json;
};
TablePair pair_of(const Analysis& analysis) { return {analysis_markdown(analysis), dumped(analysis_json(analysis))}; }

TablePair table_of(const Run& run, const std::string& name) {
  const RunTables tables = tables_of(run.rows, run);
  std::vector<std::string> known = run_analysis_names();
  known.emplace_back("metrics");
  require_known("table", name, known);
  if (name == kLeaderboardName) return pair_of(leaderboard_analysis(tables.leaderboard, tables.metrics.all, false));
  return pair_of(run_analysis(tables, name == "metrics" ? kLeaderboardName : name));
}

std::vector<EpisodeRow> rows_of(const Run& run, const std::string& policy) {
  if (policy.empty()) return run.rows;
  std::vector<EpisodeRow> rows;
  for (const EpisodeRow& row : run.rows)
    if (row.policy == policy) rows.push_back(row);
  if (rows.empty()) throw InputError(fmt::format("'{}' has no episode of the policy '{}'", run.path, policy));
  // The null arm is paired as the other policies are.
  for (EpisodeRow& row : rows)
    if (row.arm == "null") row.arm = "main";
  return rows;
}

TablePair comparison_of(const Run& a, const std::string& policy_a, const Run& b, const std::string& policy_b) {
  return pair_of(comparison_analysis(rows_of(a, policy_a), rows_of(b, policy_b)));
}

std::string rows_json(const Run& run) {
  nlohmann::json rows = nlohmann::json::array();
  for (const EpisodeRow& row : run.rows) rows.push_back(to_json(row));
  return dumped(rows);
}

std::string info_json(const Run& run) {
  return dumped(nlohmann::json({{"suite", run.info.suite},
                                {"suite_version", run.info.suite_version},
                                {"suite_hash", run.info.suite_hash},
                                {"policies", run.info.policies},
                                {"controllers", run.info.controllers},
                                {"created_at", run.info.created_at},
                                {"completeness", completeness(run)},
                                {"partial", is_partial(run)},
                                {"policy_faults", policy_fault_notes(leaderboard(run.rows))}}));
}

void add_runs(py::module_& module) {
  py::class_<TablePair>(module, "Table")
      .def_readonly("markdown", &TablePair::markdown)
      .def_readonly("json", &TablePair::json);
  py::class_<Run>(module, "RunFolder", "A run directory as it was when it was read.")
      .def(py::init([](const std::string& path) {
             Run run = load_run(path);
             add_missing_tags(run);
             return run;
           }),
           py::arg("path"), py::call_guard<py::gil_scoped_release>())
      .def_readonly("path", &Run::path)
      .def_readonly("warnings", &Run::warnings)
      .def_property_readonly("rows", &rows_json, "JSON: a list of rows.")
      .def_property_readonly("info", &info_json, "JSON: of run.json.")
      .def("table", &table_of, py::arg("name"), py::call_guard<py::gil_scoped_release>())
      .def("compare", &comparison_of, py::arg("policy_a"), py::arg("b"), py::arg("policy_b"),
           py::call_guard<py::gil_scoped_release>());
}

// JSON of what is there: the lists of `duet list`.
std::string listing(const std::string& what) {
  nlohmann::json list = nlohmann::json::array();
  if (what == "engines") {
    for (const EngineInfo& engine : engines())
      list.push_back({{"name", engine.name},
                      {"available", engine.available},
                      {"version", engine.version},
                      {"reason", engine.reason}});
  } else if (what == "policies") {
    for (const PolicyInfo& policy : policies()) list.push_back({{"name", policy.name}, {"about", policy.about}});
  } else if (what == "suites") {
    for (const std::string& name : shipped_suite_names()) list.push_back({{"name", name}});
  } else if (what == "tasks") {
    for (const std::string& name : task_names(all_tasks())) list.push_back({{"name", name}});
  } else {
    throw std::invalid_argument(fmt::format("list: expected engines, policies, suites or tasks, found '{}'", what));
  }
  return dumped(list);
}

}  // namespace

void add_evaluation(py::module_& module) {
  py::class_<Evaluation>(module, "Evaluation", "A run under way.")
      .def(py::init([](const std::string& suite, const Overrides& overrides, const std::vector<std::string>& clips,
                       bool allow_programs, const std::vector<PolicyTuple>& policies,
                       const std::map<std::string, std::vector<std::string>>& only, const std::string& output, int jobs,
                       bool retry_errors, bool replace, bool quiet, const std::vector<std::string>& argv) {
             return start({suite, overrides, clips, allow_programs}, policies, only, output, jobs, retry_errors,
                          replace, quiet, argv);
           }),
           py::arg("suite"), py::arg("overrides"), py::arg("clips"), py::arg("allow_programs"), py::arg("policies"),
           py::arg("only"), py::arg("output"), py::arg("jobs"), py::arg("retry_errors"), py::arg("replace"),
           py::arg("quiet"), py::arg("argv"))
      .def("wait", &Evaluation::wait, py::arg("seconds"), "Whether it is over.")
      .def("stop", &Evaluation::stop, "It ends at its next step, resumable.")
      .def("result", &Evaluation::result, "JSON of its summary; raises what it ended with.");
  module.def("listing", &listing, py::arg("what"));
  module.def("default_jobs", &default_threads);
  add_runs(module);
}

}  // namespace duet::python
