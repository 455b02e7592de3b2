// duet dataset stats: the tables of a data set, and how its people interact, alone or against another set.
#pragma once

#include "duet/app/command.h"

namespace duet::cli {

void add_dataset_stats(CLI::App& dataset, Session& session);

}  // namespace duet::cli
