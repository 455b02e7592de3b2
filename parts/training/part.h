// The part `training`: WBC-Sim by PPO and distillation, D-STAR and its variants.
#pragma once

#include "duet/app/part.h"

namespace duet {

Part training_part();
void add_wbc_benchmarks(std::vector<Benchmark>& list);

}  // namespace duet

namespace duet::cli {

void add_train(CLI::App& app, Session& session);
void add_train_dstar(CLI::App& train, Session& session);  // below `train`: one command per policy, and `split`

}  // namespace duet::cli
