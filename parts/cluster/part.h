// The part `cluster`: a run by shards, on one machine or on many.
#pragma once

#include "duet/app/part.h"

namespace duet {

Part cluster_part();
void add_scale_benchmarks(std::vector<Benchmark>& list);

}  // namespace duet

namespace duet::cli {

void add_plan(CLI::App& app, Session& session);
void add_work(CLI::App& app, Session& session);
void add_submit(CLI::App& app, Session& session);
void add_status(CLI::App& app, Session& session);
void add_merge(CLI::App& app, Session& session);

}  // namespace duet::cli
