// D-STAR's training (A.3.1) as a run on disk: progress, a checkpoint every minute, curves as CSV, the best network by
// validation in the form in which it ships. Killed at any time, the same call goes on from the last checkpoint.
// The arithmetic is libtorch's; where duet was built without it the call throws MissingError saying how to get it.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "duet/policies/dstar/network.h"
#include "duet/policies/language.h"
#include "duet/training/dstar/demonstrations.h"
#include "duet/training/dstar/windows.h"
#include "duet/training/threads.h"

namespace duet {

// L_total = action + lambda_phase (w_cls L_cls + w_transition L_trans) + lambda_auxiliary (w_face L_face + w_pos L_pos
// + w_spatial L_spatial). The lambdas are not in the supplement; docs/deviations.md.
struct DstarLoss {
  double translation = 10.0, rotation = 10.0, joints = 1.0;
  double lambda_phase = 100.0, lambda_auxiliary = 1.0;
  double classification = 0.0005, transition = 0.005;
  double face = 0.2, position = 5.0, spatial = 0.02;
};

struct DstarRun {
  std::string name = "dstar";  // "dp": no phase attention, no spatial reasoning, no auxiliary losses
  std::string folder;
  DstarConfig config;
  DstarLoss loss;
  WindowOptions windows;
  std::uint64_t seed = 42;
  std::shared_ptr<const DstarNetwork> from;  // weights and normalisers to begin with; none: new ones
  // "cpu", "cuda" (MissingError where libtorch has none), "auto": the GPU if there is one. Networks run there, data and
  // losses stay on the CPU.
  std::string device = "auto";
  int threads = 2;
  int batch = 128;
  long steps = 16000;
  long until = 0;            // pauses there, with a checkpoint and a network; 0: at `steps`
  double rate = 7e-4;        // Adam's, falling as a cosine to a twentieth after a warm-up of 200 steps
  double average = 0.999;    // EMA of the weights, which is what is validated and kept
  int patience = 12;         // validations without a better one after which it stops; 0: never
  int validate_every = 250;  // steps
};

// run.windows as the run's network sees them.
WindowOptions windows_of(const DstarRun& run);

struct DstarProgress {
  long step = 0, steps = 0;
  double windows_per_second = 0.0, seconds_left = 0.0;
  double loss = 0.0, action = 0.0, phase = 0.0, auxiliary = 0.0;  // of training since the last report
  double validation = 0.0;      // mean action loss of sampled plans, physical units as in L_action
  double phase_accuracy = 0.0;  // of the validation windows
};

struct DstarData {
  std::shared_ptr<const RobotModel> robot;
  std::shared_ptr<const DemonstrationSet> train, validation;
  std::shared_ptr<const LanguageEncoder> language;
};

// Largest difference between libtorch's sampled plans and DstarRunner's over `windows` validation windows, both with
// the network saved at `file`, in normalised units: what ships must be what was validated.
double runner_difference(const DstarData& data, const DstarRun& run, const std::string& file, int windows);

enum class DstarEnd { kComplete, kPaused, kEarly, kStopped };

// `report` is called about every ten seconds and after each validation. Throws std::invalid_argument for options out of
// range or sets without a window or `from` of another configuration, InputError for a checkpoint that is broken, of
// another robot, configuration or seed.
DstarEnd train_dstar(const DstarData& data, const DstarRun& run,
                     const std::function<void(const DstarProgress&)>& report, const std::function<bool()>& stop);

bool can_train_dstar();     // whether libtorch was built in
void need_dstar_trainer();  // throws MissingError, which says how to get one, where it was not
// Which BLAS libtorch has got: OpenBLAS, or the reference one that is 20 to 40 times slower, by its file; empty without
// libtorch.
std::string training_blas();

std::string dstar_checkpoint(const DstarRun& run);    // <folder>/<name>/checkpoint.safetensors
std::string dstar_network_file(const DstarRun& run);  // <folder>/<name>/network.safetensors
std::string dstar_curves(const DstarRun& run);        // <folder>/<name>/curves.csv

// The configuration of a name: "dstar", "dp", "no_phase_attention", "no_spatial_reasoning", "one_stream",
// "no_language". Throws std::invalid_argument naming them.
void set_variant(DstarRun& run, const std::string& name);
std::vector<std::string> dstar_variants();

// The log of a training of D-STAR: sums between reports, the curve as CSV, and when it is time to print and to save.

struct LossParts {
  double total = 0.0, action = 0.0, phase = 0.0, auxiliary = 0.0;
};

class DstarLog {
 public:
  // Goes on from step `done` after `minutes`; a curve of no step is begun anew.
  DstarLog(const DstarRun& run, long done, double minutes);

  void add(const LossParts& parts);
  // A line of the curve. Throws InputError where it cannot be written.
  void validated(double loss, double accuracy, long step, double rate);
  // The means since the last one.
  DstarProgress report(long step);

  [[nodiscard]] bool report_due() const { return pace_.report_due(); }
  [[nodiscard]] bool save_due() const { return pace_.save_due(); }
  void saved() { pace_.saved(); }
  [[nodiscard]] double minutes() const;

 private:
  [[nodiscard]] LossParts means() const;

  DstarRun run_;
  long first_;
  double minutes_;
  Pace pace_;
  DstarProgress progress_;
  LossParts sum_;
  int count_ = 0;
};

}  // namespace duet
