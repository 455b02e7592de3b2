#include <filesystem>

#include "duet/core/names.h"
#include "duet/training/dstar/trainer.h"

namespace duet {
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

std::vector<std::string> dstar_variants() {
  std::vector<std::string> names;
  for (const Variant& variant : kVariants) names.emplace_back(variant.name);
  return names;
}

void set_variant(DstarRun& run, const std::string& name) {
  for (const Variant& variant : kVariants) {
    if (name != variant.name) continue;
    run.name = name;
    variant.set(run);
    return;
  }
  throw std::invalid_argument(unknown_name_message("policy to train", name, dstar_variants()));
}

}  // namespace duet
