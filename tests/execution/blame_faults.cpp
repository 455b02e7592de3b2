// blame_faults [COUNT [THREADS [KIND]]]: how often `duet blame` names the fault that was put into an engine or a
// policy, over so many failed episodes of each kind, in mujoco, bullet and dart in turn. Exit code 1 below 95 of 100 of
// a kind, or where a clean episode that succeeds is blamed on anybody.
#include <fmt/format.h>

#include <cstdlib>
#include <map>

#include "tests/execution/injected_faults.h"

namespace duet {
namespace {

using test::Fault;
using test::NamedFault;

constexpr std::array<const char*, 3> kEngines = {"mujoco", "bullet", "dart"};

struct Tally {
  int tried = 0;
  std::map<Culprit, int> named;  // of those that failed; of clean ones all
  [[nodiscard]] int judged() const {
    int sum = 0;
    for (const auto& [culprit, count] : named) sum += count;
    return sum;
  }
};

std::vector<std::unique_ptr<Experiment>> experiments(int per_task, int threads, Progress& progress) {
  std::vector<std::unique_ptr<Experiment>> list;
  for (const char* engine : kEngines) {
    auto& made = list.emplace_back(
        std::make_unique<Experiment>(parse_suite(test::fault_suite(per_task, engine), "faults.yaml")));
    made->prepare(threads, progress);
  }
  return list;
}

Tally tally_of(const NamedFault& kind, const std::vector<std::unique_ptr<Experiment>>& experiments, int count,
               int threads, Progress& progress) {
  Tally tally;
  const auto episodes = static_cast<int>(experiments.front()->size() * std::ssize(experiments));
  const int batch = 2 * threads;
  for (int begin = 0; begin < episodes && tally.judged() < count; begin += batch) {
    std::vector<Culprit> found(static_cast<std::size_t>(std::min(batch, episodes - begin)));
    parallel_for_each(static_cast<int>(found.size()), threads, [&](int i) {
      const int number = begin + i;
      const Experiment& experiment = *experiments[static_cast<std::size_t>(number) % experiments.size()];
      const EpisodeSpec spec = experiment.at(number / std::ssize(experiments));
      BlameOptions options{.engines = {kEngines.begin(), kEngines.end()}, .before = {}};
      options = with_fault(options, kind.fault, spec);
      found[static_cast<std::size_t>(i)] = blame_episode(experiment, spec, options, progress).culprit;
    });
    for (const Culprit culprit : found) {
      if (tally.judged() == count) break;
      ++tally.tried;
      if (culprit != Culprit::kNobody || kind.fault == Fault::kNone) ++tally.named[culprit];
    }
  }
  return tally;
}

int run(int count, int threads, std::string_view only) {
  Progress progress(Progress::Style::kQuiet);
  const auto made = experiments(count, threads, progress);  // 6 episodes for each that is counted
  bool reached = true;
  fmt::print("| fault | expected | named | of | solver | policy | unclear | episodes tried |\n");
  fmt::print("|---|---|---|---|---|---|---|---|\n");
  for (const NamedFault& kind : test::kFaults) {
    if (!only.empty() && only != kind.name) continue;
    Tally tally = tally_of(kind, made, count, threads, progress);
    const int right = tally.named[kind.culprit], judged = tally.judged();
    fmt::print("| {} | {} | {} | {} | {} | {} | {} | {} |\n", kind.name, to_string(kind.culprit), right, judged,
               tally.named[Culprit::kSolver], tally.named[Culprit::kPolicy], tally.named[Culprit::kUnclear],
               tally.tried);
    std::fflush(stdout);
    // A clean episode may fail, in every engine: then that is the policy's.
    const int wrong = kind.fault == Fault::kNone ? tally.named[Culprit::kSolver] : judged - right;
    reached = reached && judged > 0 && wrong * 20 <= judged && (kind.fault != Fault::kNone || wrong == 0);
  }
  return reached ? 0 : 1;
}

}  // namespace
}  // namespace duet

int main(int argc, char** argv) {
  return duet::run(argc > 1 ? std::atoi(argv[1]) : 100, argc > 2 ? std::atoi(argv[2]) : 2, argc > 3 ? argv[3] : "");
}
