#include "duet/rows/groups/row_field_list.h"

#include <fmt/format.h>

#include <type_traits>
#include <variant>

#include "duet/rows/episode_row.h"
#include "duet/rows/groups/database.h"

namespace duet {
namespace {

template <typename Owner, typename... More>
RowFieldInfo described(const JsonMember<Owner, More...>& known) {
  const std::string unit = known.unit.empty() ? "" : fmt::format(" [{}]", known.unit);
  return {std::string(known.name), std::string(member_words(known)), std::string(known.meaning) + unit, {}, {}};
}

template <RowPart Part>
std::vector<RowFieldInfo> members_of(ValueType<Part>) {
  std::vector<RowFieldInfo> members;
  for (const JsonMember<Part>& known : part_members<Part>()) members.push_back(described(known));
  return members;
}
template <RowPart Part>
std::vector<RowFieldInfo> members_of(ValueType<std::vector<Part>>) {
  return members_of(ValueType<Part>());
}
template <typename Value>
std::vector<RowFieldInfo> members_of(ValueType<Value>) {
  return {};
}

}  // namespace

std::vector<RowFieldInfo> row_field_list() {
  std::vector<RowFieldInfo> list = {
      {"schema", "integer", fmt::format("{}, the only one that is read", kRowSchema), {}, {}}};
  for (const RowField& field : row_fields()) {
    RowFieldInfo& info = list.emplace_back(described(field.json));
    if (!field.use.repeats) info.meaning += "; differs from run to run";
    if (field.use.heavy) info.meaning += "; null in published rows";
    info.columns = database_columns(field);
    info.members = std::visit([]<typename Value>(Value EpisodeRow::*) { return members_of(ValueType<Value>()); },
                              field.json.member);
  }
  return list;
}

}  // namespace duet
