// The log of a training of D-STAR: sums between reports, the curve as CSV, and when it is time to print and to save.
#pragma once

#include "duet/training/dstar/trainer.h"
#include "duet/training/pace.h"

namespace duet {

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
