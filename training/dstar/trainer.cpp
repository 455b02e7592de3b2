#include "duet/training/dstar/trainer.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/named_table.h"

namespace duet {
namespace {

constexpr const char* kDstarColumns = "step,minutes,loss,action,phase,auxiliary,validation,phase_accuracy,rate\n";

}  // namespace

DstarLog::DstarLog(const DstarRun& run, long done, double minutes) : run_(run), first_(done), minutes_(minutes) {
  std::filesystem::create_directories(std::filesystem::path(dstar_curves(run)).parent_path());
  if (done == 0) write_file(dstar_curves(run), kDstarColumns);
}

void DstarLog::add(const LossParts& parts) {
  sum_.total += parts.total;
  sum_.action += parts.action;
  sum_.phase += parts.phase;
  sum_.auxiliary += parts.auxiliary;
  ++count_;
}

LossParts DstarLog::means() const {
  const double n = std::max(1, count_);
  return {sum_.total / n, sum_.action / n, sum_.phase / n, sum_.auxiliary / n};
}

void DstarLog::validated(double loss, double accuracy, long step, double rate) {
  progress_.validation = loss;
  progress_.phase_accuracy = accuracy;
  const LossParts mean = means();
  LineAppender(dstar_curves(run_))
      .append(fmt::format("{},{:.3f},{:.5f},{:.5f},{:.5f},{:.5f},{:.5f},{:.4f},{:.2e}", step, minutes(), mean.total,
                          mean.action, mean.phase, mean.auxiliary, loss, accuracy, rate));
}

DstarProgress DstarLog::report(long step) {
  const LossParts mean = means();
  DstarProgress progress = progress_;
  progress.step = step;
  progress.steps = run_.steps;
  progress.loss = mean.total;
  progress.action = mean.action;
  progress.phase = mean.phase;
  progress.auxiliary = mean.auxiliary;
  const double speed = static_cast<double>(step - first_) / std::max(1e-9, pace_.seconds());
  progress.windows_per_second = speed * run_.batch;
  progress.seconds_left = static_cast<double>(run_.steps - step) / std::max(1e-9, speed);
  sum_ = {};
  count_ = 0;
  pace_.reported();
  return progress;
}

double DstarLog::minutes() const { return minutes_ + pace_.seconds() / 60.0; }

namespace {

namespace fs = std::filesystem;

struct Variant {
  const char* name;
  void (*set)(DstarRun& run);
};

void plain(DstarRun& run) {
  run.config.phase_attention = run.config.spatial_reasoning = false;
  run.loss.lambda_phase = run.loss.lambda_auxiliary = 0.0;
}

constexpr Variant kVariants[] = {
    {"dstar", [](DstarRun&) {}},
    {"dp", plain},
    {"no_phase_attention", [](DstarRun& run) { run.config.phase_attention = false; }},
    {"no_spatial_reasoning", [](DstarRun& run) { run.config.spatial_reasoning = false; }},
    {"one_stream", [](DstarRun& run) { run.config.short_stream = false; }},
    {"no_language", [](DstarRun& run) { run.config.language_on = false; }},
};

std::string file_of(const DstarRun& run, const char* name) { return (fs::path(run.folder) / run.name / name).string(); }

}  // namespace

WindowOptions windows_of(const DstarRun& run) {
  WindowOptions options = run.windows;
  options.long_stride = run.config.long_stride;
  return options;
}

std::string dstar_checkpoint(const DstarRun& run) { return file_of(run, "checkpoint.safetensors"); }
std::string dstar_network_file(const DstarRun& run) { return file_of(run, "network.safetensors"); }
std::string dstar_curves(const DstarRun& run) { return file_of(run, "curves.csv"); }

std::vector<std::string> dstar_variants() { return names_of(kVariants); }

void set_variant(DstarRun& run, const std::string& name) {
  const Variant& variant = entry_named(kVariants, "policy to train", name);
  run.name = name;
  variant.set(run);
}

}  // namespace duet
