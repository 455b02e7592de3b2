// A controller table as titled tables of text, for Markdown, LaTeX and HTML: internal to those writers.
#pragma once

#include <string>
#include <vector>

#include "duet/results/analyses/controller_table.h"
#include "duet/results/analyses/cross_engine_tables.h"

namespace duet {

// Jitter before and after the controller; tracking, survival and faults. Each with the paper's rows at its end.
std::vector<TitledTable> controller_tables(const ControllerTable& table);

std::string no_controllers();  // the sentence for a table without entries

}  // namespace duet
