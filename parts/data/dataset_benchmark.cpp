// Recordings to data set, all stages: read, resample, judge, retarget, score, write.
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "duet/app/benchmarks/parts.h"
#include "duet/app/benchmarks/timer.h"
#include "duet/archives/npy/npy.h"
#include "duet/core/file.h"
#include "duet/core/scratch_folder.h"
#include "duet/datasets/dataset.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/parts/data/part.h"

namespace duet {
namespace {

constexpr int kRecordings = 48;
constexpr double kRecordedRate = 120.0;  // of optical motion capture, as in Inter-X [Hz]

// (T, 2, 24, 3) at 120 Hz. Its seconds.
double write_recording(const std::string& path, int index) {
  SynthesisOptions options;
  options.index = index;
  const InteractionClip clip = synthesize(Task::kHandshake, options);
  const HumanMotion people[] = {resample(clip.a, kRecordedRate), resample(clip.b, kRecordedRate)};
  const int frames = people[0].frames();
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(frames) * 2 * kSmplJoints * 3);
  for (int t = 0; t < frames; ++t)
    for (const HumanMotion& person : people) {
      const PointTracks::ConstFrame frame = person.joints.frame(t);
      values.insert(values.end(), frame.data(), frame.data() + frame.size());
    }
  write_file(path,
             npy_bytes({.shape = {static_cast<std::size_t>(frames), 2, kSmplJoints, 3}, .values = std::move(values)}));
  return frames / kRecordedRate;
}

std::vector<BenchmarkFigure> time_dataset(const BenchmarkOptions& options) {
  const ScratchFolder folder;
  std::filesystem::create_directory(folder / "recordings");
  double recorded = 0.0;
  for (int i = 0; i < kRecordings; ++i)
    recorded += write_recording(folder / fmt::format("recordings/r{:02}.npy", i), i);
  DatasetPlan plan{.inputs = {folder / "recordings"},
                   .robots = {{.name = "g1", .model = load_shared_robot()}},
                   .pair = make_pair_options({{"mode", "best"}}),
                   .threads = options.threads};
  plan.people.task = Task::kHandshake;
  plan.people.rate_hz = kRecordedRate;
  plan.curation.gates.clear();  // all are made
  const double begin = wall_seconds();
  const DatasetSummary summary = make_dataset(plan, folder / "data");
  const double seconds = wall_seconds() - begin;
  const std::string name = "dataset/end_to_end";
  std::vector<BenchmarkFigure> figures = {at_least(name, recorded / seconds, "h/h", 1000.0),
                                          at_most(name + ":peak_memory", peak_memory_mib(), "MiB", 2048.0),
                                          {name + ":clips", static_cast<double>(summary.kept), "1", "", true}};
  double all = 0.0;
  for (const auto& [stage, time] : summary.seconds) all += time;
  for (const auto& [stage, time] : summary.seconds)
    figures.push_back({fmt::format("{}:{}", name, stage), 100.0 * time / all, "%", "", true});
  return figures;
}

}  // namespace

void add_dataset_benchmarks(std::vector<Benchmark>& list) {
  list.push_back(
      {"dataset/end_to_end",
       fmt::format("{} two-person recordings of 24 joints at 120 Hz to a data set of the G1 (mode best)", kRecordings),
       time_dataset});
}

}  // namespace duet
