// What `duet train` may be told, declared once.
#pragma once

#include <optional>
#include <string>

#include "duet/bench/demonstrations.h"
#include "duet/core/field.h"
#include "duet/training/dstar/trainer.h"
#include "duet/training/train_wbc.h"

namespace duet {

// `duet train wbc`.
struct WbcTraining {
  WbcTraining() { run.folder = "runs/wbc"; }
  WbcRun run;
  std::optional<int> threads;  // none: as the machine has
  std::string stage = "all", card;
};
const FieldTable<WbcTraining>& wbc_training_fields();

enum class TrainingStart { kApproach, kSimToReal };

// `duet train dstar`, of its variants and of `retrieval`.
struct PolicyTraining {
  PolicyTraining() { run.folder = "runs/policies"; }
  DstarRun run;
  DemonstrationOptions data;
  std::optional<int> threads;  // none: as the machine has
  std::string config, language, split, from;
  TrainingStart start = TrainingStart::kApproach;
  int rounds = 2, round_clips = 120;
};
const FieldTable<PolicyTraining>& policy_training_fields();

}  // namespace duet
