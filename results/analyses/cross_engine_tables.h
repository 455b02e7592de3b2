// A cross-engine comparison as titled tables of text, for Markdown, LaTeX and HTML: internal to those writers.
#pragma once

#include <string>
#include <vector>

#include "duet/results/analyses/cross_engine.h"
#include "duet/results/analyses/text_table.h"

namespace duet {

struct TitledTable {
  std::string title;
  std::string caption;             // what all rows have in common, "" for nothing
  TextTable table;                 // without rows: the notes say why
  std::vector<std::string> notes;  // sentences below it
};

// Empty for fewer than two physics engines.
std::vector<TitledTable> cross_engine_tables(const CrossEngine& result);
// The sentence in their place.
std::string too_few_engines(const CrossEngine& result);

// The parity certificate as a table, with a note for each engine of these results that it does not cover as it was run.
// Read tolerantly: what is missing is "-". null: a table without rows that says that none is attached.
TitledTable certificate_table(const nlohmann::json& certificate, const std::vector<RunEngine>& engines);

// "### title", caption, table, notes.
std::string markdown_of(const TitledTable& titled);
// The title, caption and notes as comments, then the tabular.
std::string latex_of(const TitledTable& titled);

// Names of the combinations: columns "Controller", "Perturbation", "Policy" as far as they differ, and what they have
// in common ("Controller vmc, perturbation clean."). Of all entries in turn.
struct CombinationLabels {
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> cells;
  std::string caption;
};
CombinationLabels combination_labels(const std::vector<EngineSuccess>& success);

}  // namespace duet
