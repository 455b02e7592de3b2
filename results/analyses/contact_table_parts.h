// Parts of the contact table: the reading of a row; titled tables of text for Markdown, LaTeX and HTML.
#pragma once

#include <string>
#include <vector>

#include "duet/results/analyses/contact_table.h"
#include "duet/results/analyses/cross_engine_tables.h"

namespace duet {

inline constexpr std::string_view kContactTitle = "Contact with people";

std::string contact_group_name(const ContactGroup& group);  // "Controller vmc, policy replay"

// Peak force with the ratio to the limit, a column per engine; the other figures over all engines.
std::vector<TitledTable> contact_group_tables(const ContactGroup& group);

// How to read the tables, one sentence or two each.
std::vector<std::string> contact_notes();

std::string no_contacts();  // the sentence for a table without groups

}  // namespace duet
