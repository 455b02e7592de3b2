// duet bench: figures of this code on this machine, in Google Benchmark's form.
#include <fmt/format.h>

#include <ctime>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/app/part.h"
#include "duet/app/version.h"
#include "duet/core/machine.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/rows/folder/environment.h"

namespace duet::cli {
namespace {

struct BenchArguments {
  std::vector<std::string> names;
  BenchmarkOptions options;
  bool gate = false;
};

// A name stands for itself and for everything below it: "pair" is every benchmark "pair/...".
bool chosen(const std::string& benchmark, const std::vector<std::string>& names) {
  if (names.empty()) return true;
  for (const std::string& name : names)
    if (benchmark == name || benchmark.starts_with(name + "/")) return true;
  return false;
}

void check_names(const std::vector<std::string>& names) {
  std::vector<std::string> known = {"detectors"};
  for (const Benchmark& benchmark : benchmarks()) known.push_back(benchmark.name);
  for (const std::string& name : names) {
    bool found = name == "detectors";
    for (const Benchmark& benchmark : benchmarks()) found = found || chosen(benchmark.name, {name});
    require(found, unknown_name_message("benchmark", name, known));
  }
}

nlohmann::json to_json(const BenchmarkFigure& figure) {
  nlohmann::json json = {{"name", figure.name}, {"value", figure.value}, {"unit", figure.unit}};
  if (!figure.target.empty()) {
    json["target"] = figure.target;
    json["reached"] = figure.reached;
  }
  return json;
}

std::string line(const BenchmarkFigure& figure) {
  const std::string target =
      figure.target.empty() ? "" : fmt::format("{} ({})", figure.target, figure.reached ? "reached" : "NOT reached");
  return fmt::format("{:<44} {:>12.5g} {:<10} {}\n", figure.name, figure.value, figure.unit, target);
}

void run_bench(Session& session, const BenchArguments& arguments) {
  check_names(arguments.names);
  if (arguments.names == std::vector<std::string>{"detectors"})
    throw MissingError(missing_part_message("`duet bench detectors`", "data"));
  nlohmann::json json = {{"context", capture_environment()}, {"benchmarks", nlohmann::json::array()}};
  json["context"]["duet_version"] = duet_version();
  json["context"]["machine"] = describe_machine();
  nlohmann::json missing = nlohmann::json::array();
  if (!session.json) fmt::print("{}\n{}\n", version_text(), describe_machine());
  for (const Benchmark& benchmark : benchmarks()) {
    if (!chosen(benchmark.name, arguments.names)) continue;
    note(session, "measuring " + benchmark.name);
    std::vector<BenchmarkFigure> figures;
    try {
      figures = benchmark.run(arguments.options);
    } catch (const MissingError& error) {
      if (!arguments.names.empty()) throw;  // asked for by name
      missing.push_back({{"name", benchmark.name}, {"lacks", error.what()}});
      continue;
    }
    for (const BenchmarkFigure& figure : figures) {
      json["benchmarks"].push_back(to_json(figure));
      if (arguments.gate && !figure.reached) session.exit_code = kExitGate;
      if (!session.json) fmt::print("{}", line(figure));
    }
  }
  for (const nlohmann::json& one : missing)
    warn(fmt::format("{} was not measured: {}", one["name"].get<std::string>(), one["lacks"].get<std::string>()));
  json["missing"] = std::move(missing);
  if (session.json) print(session, "", json);
}

}  // namespace

void add_bench(CLI::App& app, Session& session) {
  CLI::App* command =
      add_command(app, session, "bench",
                  "measure this code on this machine; `bench detectors` prints how well detectors tell acts apart",
                  "duet bench pair/paper backend --json\n"
                  "  duet bench detectors --clips 200 --thresholds act\n"
                  "  duet bench detectors --clips recordings --labels labels.csv --list");
  auto arguments = std::make_shared<BenchArguments>();
  arguments->options.threads = default_threads();
  command->add_option("names", arguments->names, "which, by path; `duet list benchmarks` shows all (default: all)");
  command->add_option("--seconds", arguments->options.seconds, "measuring time of one figure, up to an hour")
      ->capture_default_str()
      ->check(CLI::Range(0.001, 3600.0));
  add_threads(command, arguments->options.threads, "threads of the scaling figures");
  command->add_flag("--gate", arguments->gate, "exit code 1 where a figure does not reach its target");
  const Instead of_part = added_by_part("bench", *command);
  command->callback([&session, arguments, of_part] {
    if (!of_part(session, {.words = arguments->names, .threads = arguments->options.threads}))
      run_bench(session, *arguments);
  });
}

}  // namespace duet::cli
