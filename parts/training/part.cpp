#include "duet/parts/training/part.h"

#include "duet/training/dstar/trainer.h"
#include "duet/training/setup/train_options.h"

namespace duet {
namespace {

std::vector<OptionSection> train_option_sections() {
  return {{"wbc", field_rows(wbc_training_fields(), WbcTraining())},
          {"dstar", field_rows(policy_training_fields(), PolicyTraining())}};
}

std::vector<Finding> findings() {
  return {{"training of policies", can_train_dstar(),
           can_train_dstar() ? "libtorch with " + training_blas()
                             : "built without libtorch; `./run train dstar` builds a program with it"}};
}

}  // namespace

Part training_part() {
  return {.name = "training",
          .commands = {{"train", cli::add_train}},
          .extensions = {},
          .lists = {},
          .option_lists = {{"train-options", train_option_sections}},
          .benchmarks = {{"wbc", add_wbc_benchmarks}},
          .findings = findings};
}

}  // namespace duet
