// The cost of a run on many machines beside its episodes, and what follows for a thousand nodes (docs/performance.md).
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/backends/engine_module.h"
#include "duet/cluster/attempt.h"
#include "duet/cluster/plan_run.h"
#include "duet/cluster/run_status.h"
#include "duet/cluster/work_shard.h"
#include "duet/core/file.h"
#include "duet/core/file_batch.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/execution/experiment.h"
#include "duet/parts/cluster/part.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/merge/merge_files.h"
#include "duet/rows/merge/row_merge.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScaleSuite = R"(
schema: duet.suite/1
name: bench-scale
version: 1.0.0
clips: {synth: {per_task: 24, seed: 42}}
tasks: [wave, high_five]
engines: [mujoco]
controllers: [vmc]
policies: [replay]
)";
constexpr double kShardOfTwoMinutes = 120.0;  // [s]

// A planned run in a folder that is removed again.
class ScaleRun {
 public:
  explicit ScaleRun(std::int64_t shards) {
    suite_ = parse_suite(kScaleSuite, "bench-scale");
    if (!is_available("mujoco")) throw MissingError("bench scale needs the engine mujoco");
    PlanOptions options;
    options.shards = shards;
    plan_run(suite_, run(), options, stop_, quiet_);
  }
  [[nodiscard]] const std::string& folder() const { return folder_.path(); }
  [[nodiscard]] std::string run() const { return folder_ / "run"; }
  WorkSummary work(std::int64_t shard) { return work_shard(run(), shard, {}, stop_, quiet_); }
  // Removes the results of the attempts so far: all is to be done again.
  void forget() const { fs::remove_all(run() + "/attempts"); }
  [[nodiscard]] EpisodeRow a_row() const {
    for (const std::int64_t shard : attempted_shards(run()))
      for (const AttemptRecord& attempt : read_attempts(run(), shard)) {
        LineFile lines(attempt.rows_file);
        if (const auto line = lines.next()) return row_from_json(parse_json(*line, attempt.rows_file));
      }
    throw InputError("bench scale: no row was made");
  }

 private:
  ScratchFolder folder_;
  Suite suite_;
  StopToken stop_;
  Progress quiet_{Progress::Style::kQuiet};
};

// CPU time of all threads. `who`: RUSAGE_SELF, or RUSAGE_CHILDREN for the processes that have ended.
double used_cpu_seconds(int who) {
  struct rusage usage {};
  getrusage(who, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1.0e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

struct Spent {
  double wall = 0.0, cpu = 0.0;  // [s]
};

// The shards in processes of their own, of one thread each: so many at a time.
Spent run_workers(const ScaleRun& run, int shards, int at_once) {
  const std::string program = fs::read_symlink("/proc/self/exe").string();
  Spent spent{-wall_seconds(), -used_cpu_seconds(RUSAGE_CHILDREN)};
  for (int first = 0; first < shards; first += at_once) {
    std::vector<std::FILE*> workers;
    for (int shard = first; shard < std::min(shards, first + at_once); ++shard)
      workers.push_back(::popen(fmt::format("exec {} work {} --shard {} -j 1 --quiet >/dev/null", shell_word(program),
                                            shell_word(run.run()), shard)
                                    .c_str(),
                                "r"));
    for (std::FILE* worker : workers)
      if (worker == nullptr || ::pclose(worker) != 0) throw InputError("bench scale: a worker failed");
  }
  spent.wall += wall_seconds();
  spent.cpu += used_cpu_seconds(RUSAGE_CHILDREN);
  return spent;
}

// [s] of a worker that finds nothing to do: start, digests, suite, policies, what is done already.
double start_seconds(ScaleRun& run) {
  const Spent spent = run_workers(run, 1, 1);
  return spent.wall;
}

// [s] a row: on disk, and its lines in the journal.
double record_seconds(const ScaleRun& run, double seconds) {
  AttemptWriter attempt(run.folder(), new_attempt(0, ""));
  EpisodeRow row = run.a_row();
  int count = 0;
  const double begin = wall_seconds();
  for (; wall_seconds() - begin < seconds || count < 10; ++count) {
    attempt.began(row.key);
    attempt.append(row);
  }
  return (wall_seconds() - begin) / count;
}

// Rows of as many episodes as a file each of 10,000, alike but for number and key.
std::vector<RowSource> write_rows(const ScaleRun& run, std::int64_t rows, double& row_bytes) {
  EpisodeRow row = run.a_row();
  const std::string line = dumped(to_json(row));
  row_bytes = static_cast<double>(line.size() + 1);
  const std::string number = fmt::format("\"episode\":{},", row.episode);
  const std::size_t at_number = line.find(number), at_key = line.find(row.key);
  constexpr std::int64_t kRowsOfFile = 10'000;
  std::vector<RowSource> sources;
  for (std::int64_t begin = 0; begin < rows; begin += kRowsOfFile) {
    sources.push_back({.path = fmt::format("{}/rows-{}.jsonl", run.folder(), sources.size()),
                       .from = "rows",
                       .run = 0,
                       .shard = static_cast<int>(sources.size()),
                       .node = "n1"});
    std::ofstream file(sources.back().path, std::ios::binary);
    for (std::int64_t i = begin; i < std::min(rows, begin + kRowsOfFile); ++i) {
      row.episode = static_cast<int>(i);
      file << std::string_view(line).substr(0, at_number) << "\"episode\":" << i << ','
           << std::string_view(line).substr(at_number + number.size(), at_key - at_number - number.size())
           << episode_key(row) << std::string_view(line).substr(at_key + row.key.size()) << '\n';
    }
  }
  return sources;
}

std::vector<BenchmarkFigure> time_merge(const BenchmarkOptions& options) {
  ScaleRun run(1);
  const auto rows = static_cast<std::int64_t>(std::clamp(1.0e5 * options.seconds, 1.0e4, 1.0e6));
  double row_bytes = 0.0;
  const std::vector<RowSource> sources = write_rows(run, rows, row_bytes);
  RunInfo info;
  info.suite_hash = run.a_row().suite_hash;
  forget_peak_memory();  // clips were prepared before
  const double begin = wall_seconds(), cpu = used_cpu_seconds(RUSAGE_SELF);
  const MergedRows merged = merge_rows(sources, info, run.folder() + "/merged.jsonl");
  const double wall = wall_seconds() - begin, used = used_cpu_seconds(RUSAGE_SELF) - cpu;
  if (merged.rows != rows) throw InputError("bench scale: rows were lost");
  const double million = 1.0e6 / static_cast<double>(rows);
  return {{"scale/merge:rows", static_cast<double>(rows), "1", "", true},
          {"scale/merge:row_bytes", row_bytes, "B", "", true},
          at_most("scale/merge:million_rows", wall * million, "s", 30.0),
          {"scale/merge:million_rows_cpu", used * million, "s", "", true},
          at_most("scale/merge:peak_memory", peak_memory_mib(), "MiB", 200.0)};
}

struct Constants {
  double start = 0.0, record = 0.0;    // [s] a worker, a row
  double episode = 0.0, status = 0.0;  // [s] an episode of one core, an attempt in `duet status`
};

// All shards anew, twice: another guest of the machine may slow a round down, so the faster counts.
Spent faster_of_two(const ScaleRun& run, int shards, int at_once) {
  const auto round = [&] {
    run.forget();
    return run_workers(run, shards, at_once);
  };
  const Spent first = round(), second = round();
  return first.wall < second.wall ? first : second;
}

Constants measure(const BenchmarkOptions& options, Spent& one, Spent& two) {
  constexpr int kShards = 4;
  ScaleRun run(kShards);
  Constants constants;
  two = faster_of_two(run, kShards, 2);
  one = faster_of_two(run, kShards, 1);
  const RunStatus status = run_status(run.run());
  for (const auto& [name, node] : status.nodes)
    constants.episode += node.seconds / static_cast<double>(std::max<std::int64_t>(node.done, 1));
  const double begin = wall_seconds();
  static_cast<void>(run_status(run.run()));
  constants.status = (wall_seconds() - begin) / kShards;
  constants.start = start_seconds(run);
  constants.record = record_seconds(run, 0.5 * options.seconds);
  return constants;
}

// The share of a two-minute shard that is not spent on episodes.
double overhead_of(const Constants& constants) {
  const double episodes = kShardOfTwoMinutes / (constants.episode + constants.record);
  return (constants.start + episodes * constants.record) / (constants.start + kShardOfTwoMinutes);
}

// A hundred million episodes on so many nodes of 32 cores. A file system server that syncs as this disk does would have
// to sync so many rows a second.
void project(const Constants& constants, double nodes, std::vector<BenchmarkFigure>& figures) {
  constexpr double kEpisodes = 1.0e8, kCores = 32.0;
  const double core = kEpisodes * (constants.episode + constants.record);
  const double shards = core / kShardSeconds;
  const double workers = nodes * kCores;
  const double rounds = std::ceil(shards / workers);
  const std::string name = fmt::format("scale/projection/{:g}_nodes", nodes);
  figures.push_back({name + ":hours", rounds * (kShardSeconds + constants.start) / 3600.0, "h", "", true});
  figures.push_back({name + ":shards", shards, "1", "", true});
  figures.push_back({name + ":rows_per_second", workers / (constants.episode + constants.record), "1/s", "", true});
  figures.push_back({name + ":syncs_of_this_disk", 1.0 / constants.record, "1/s", "", true});
  figures.push_back({name + ":status", shards * constants.status, "s", "", true});
}

std::vector<BenchmarkFigure> time_workers(const BenchmarkOptions& options) {
  Spent one, two;
  const Constants constants = measure(options, one, two);
  std::vector<BenchmarkFigure> figures;
  figures.push_back({"scale/worker:start", constants.start, "s", "", true});
  figures.push_back({"scale/worker:record_row", 1.0e3 * constants.record, "ms", "", true});
  figures.push_back({"scale/worker:episode", constants.episode, "s", "", true});
  figures.push_back({"scale/status:attempt", 1.0e6 * constants.status, "us", "", true});
  figures.push_back(at_most("scale/shard_of_two_minutes:overhead", 100.0 * overhead_of(constants), "%", 1.0));
  figures.push_back(at_least("scale/two_workers:efficiency", one.wall / two.wall, "1", 1.9));
  figures.push_back({"scale/two_workers:cpu_efficiency", 2.0 * one.cpu / two.cpu, "1", "", true});
  figures.push_back({"scale/dead_worker:lost_at_most", constants.episode, "s", "", true});
  for (const double nodes : {10.0, 100.0, 1000.0}) project(constants, nodes, figures);
  return figures;
}

}  // namespace

void add_scale_benchmarks(std::vector<Benchmark>& list) {
  list.push_back(
      {"scale/workers", "workers of a planned run: start, rows, two against one, a thousand nodes", time_workers});
  list.push_back({"scale/merge", "rows of many files as one; --seconds 10 merges a million", time_merge});
}

}  // namespace duet
