// Options of `duet train`, declared once.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/field.h"
#include "duet/training/dstar/trainer.h"
#include "duet/training/setup/demonstrations.h"
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

enum class TrainingStart { kApproach, kSimToReal, kAnswer, kLead };

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

// Options that a list of trainings may give to one: the fields above but `output` and `seed`, which follow from its arm
// and seed, and the flags `smoke` and `quiet`. Name as in the tables -> value as text; for a flag empty.
using TrainingOptions = std::map<std::string, std::string>;

// Those that lists and plans may name: "wbc", "dstar" and its variants.
std::vector<std::string> training_names();
// Throws InputError that begins with `what` for an option that this training does not have, and for a value that is
// none of it.
void check_training_option(const std::string& train, const std::string& name, const std::string& value,
                           const std::string& what);
// Options from the words of a command line: --steps 100, --steps=100, --clips people:4 rehearsed:2, --smoke. Throws
// InputError as above, and for an option that is given twice.
TrainingOptions parse_training_options(const std::string& train, const std::vector<std::string>& words,
                                       const std::string& what);
// The command line of `duet` that trains so: "train" always is its first word, each option's value one word.
std::vector<std::string> training_command(const std::string& train, const TrainingOptions& options, std::uint64_t seed,
                                          const std::string& folder);

}  // namespace duet
