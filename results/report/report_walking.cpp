// The section "Walking by command" of the HTML report.
#include "duet/results/analyses/cross_engine_tables.h"
#include "duet/results/report/report_parts.h"

namespace duet {

std::string walking_html(const WalkTable& table) {
  return table.entries.empty() ? "" : titled_table_html(walk_titled(table));
}

}  // namespace duet
