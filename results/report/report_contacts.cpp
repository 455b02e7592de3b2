// The section "Contact with people" of the HTML report.
#include <fmt/format.h>

#include "duet/results/analyses/contact_table_parts.h"
#include "duet/results/report/escape_html.h"
#include "duet/results/report/report_parts.h"

namespace duet {
namespace {

std::string group_html(const ContactGroup& group) {
  std::string html;
  for (const TitledTable& titled : contact_group_tables(group)) html += titled_table_html(titled);
  return html;
}

}  // namespace

std::string contacts_html(const ContactTable& table) {
  if (table.groups.empty()) return "";
  std::string html =
      fmt::format("<p{}>{}</p>\n", table.limits_verified ? "" : R"( class="warning")", escape_html(limits_mark(table)));
  for (const std::string& note : contact_notes()) html += fmt::format("<p>{}</p>\n", escape_html(note));
  if (table.groups.size() == 1) return html + group_html(table.groups.front());
  for (const ContactGroup& group : table.groups) {
    html +=
        fmt::format("<details{}><summary>{}</summary>{}</details>\n", &group == &table.groups.front() ? " open" : "",
                    escape_html(contact_group_name(group)), group_html(group));
  }
  return html;
}

}  // namespace duet
