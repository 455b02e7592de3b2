// The part `data`: motions of others, people's and robots', and data sets that are made of them.
#pragma once

#include "duet/app/part.h"

namespace duet {

Part data_part();
void add_dataset_benchmarks(std::vector<Benchmark>& list);

}  // namespace duet

namespace duet::cli {

void add_import(CLI::App& app, Session& session);
void add_convert(CLI::App& app, Session& session);
void add_dataset(CLI::App& app, Session& session);  // `dataset inspect`, `curate`, `retarget`, `convert`, ...

// `duet score --people`, `duet bench detectors`: their options beside those of the core's command.
Instead add_people_scoring(CLI::App& command);
Instead add_detector_tables(CLI::App& command);

}  // namespace duet::cli
