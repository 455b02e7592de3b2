// What a training of D-STAR reports: sums between reports, the curve as CSV, and when it is time to print and to save.
#pragma once

#include <chrono>

#include "training/dstar/trainer.h"

namespace duet {

struct LossParts {
  double total = 0.0, action = 0.0, phase = 0.0, auxiliary = 0.0;
};

class DstarLog {
 public:
  // From step `done` after `minutes`; a curve of no step is begun anew.
  DstarLog(const DstarRun& run, long done, double minutes);

  void add(const LossParts& parts);
  void validated(double loss, double accuracy, long step, double rate);
  // The means since the last one.
  DstarProgress report(long step);

  [[nodiscard]] bool report_due() const;
  [[nodiscard]] bool save_due() const;
  void saved() { saved_ = Clock::now(); }
  [[nodiscard]] double minutes() const;

 private:
  using Clock = std::chrono::steady_clock;
  [[nodiscard]] LossParts means() const;

  DstarRun run_;
  long first_;
  double minutes_;
  Clock::time_point begin_ = Clock::now(), reported_ = begin_, saved_ = begin_;
  DstarProgress progress_;
  LossParts sum_;
  int count_ = 0;
};

}  // namespace duet
