#include "duet/hardware/safety/checklist.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <chrono>
#include <cmath>

#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/named_table.h"
#include "duet/core/require.h"
#include "duet/robots/yaml_schema.h"

namespace duet {
namespace {

constexpr const char* kChecklistSchema = "duet.checklist/1";
constexpr double kClocksApart = 300.0;  // of who filled it in and of this computer [s]

std::string time_text(double at) {
  return fmt::format("{:%Y-%m-%dT%H:%MZ}", fmt::gmtime(static_cast<std::time_t>(at)));
}

// The time that "2026-11-28T10:15Z" says [s]; NaN for another form.
double time_of(const std::string& text) {
  constexpr std::string_view kForm = "0000-00-00T00:00Z";
  bool good = text.size() == kForm.size();
  for (std::size_t k = 0; good && k < kForm.size(); ++k)
    good = kForm[k] == '0' ? std::isdigit(static_cast<unsigned char>(text[k])) != 0 : text[k] == kForm[k];
  if (!good) return std::nan("");
  const auto number = [&](std::size_t from, std::size_t size) {
    int value = 0;
    std::from_chars(text.data() + from, text.data() + from + size, value);
    return value;
  };
  const std::chrono::year_month_day day{std::chrono::year(number(0, 4)),
                                        std::chrono::month(static_cast<unsigned>(number(5, 2))),
                                        std::chrono::day(static_cast<unsigned>(number(8, 2)))};
  const int hour = number(11, 2), minute = number(14, 2);
  if (!day.ok() || hour > 23 || minute > 59) return std::nan("");
  const auto days = std::chrono::sys_days(day).time_since_epoch().count();
  return 86400.0 * static_cast<double>(days) + 3600.0 * hour + 60.0 * minute;
}

const Schema<Checklist>& checklist_schema() {
  using C = Checklist;
  static const Schema<C> schema = {{"schema"},
                                   required_key({"robot"}, &C::robot),
                                   required_key({"who"}, &C::who),
                                   required_key({"when"}, &C::when),
                                   required_key({"configuration"}, &C::configuration),
                                   required_key({"card"}, &C::card),
                                   {"items"}};
  return schema;
}

void check_value(const YamlSection& section, const ChecklistItem& item, const std::string& text) {
  if (item.value != ChecklistValue::kNumber) return;
  double value = std::nan("");
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value) || value < item.least)
    section.fail(section.line("value"),
                 fmt::format("key 'value': expected a number, {:g} or more, found '{}'", item.least, text));
}

ChecklistAnswer read_answer(const std::string& file, const YAML::Node& node, const ChecklistItem& item) {
  const bool has_value = item.value != ChecklistValue::kNone;
  std::vector<const char*> keys = {"done"};
  if (has_value) keys.push_back("value");
  const YamlSection section(file, node, fmt::format("item '{}'", item.name), keys);
  ChecklistAnswer answer;
  read_value(section, {"done"}, answer.done);
  if (!answer.done || !has_value) return answer;
  if (!section.has("value")) section.fail(section.line(), fmt::format("is done without its 'value': {}", item.step));
  read_value(section, {"value"}, answer.value);
  check_value(section, item, answer.value);
  return answer;
}

}  // namespace

std::vector<std::string> checklist_names() { return names_of(kChecklist); }

std::string empty_checklist(const std::string& robot, const std::string& configuration, const std::string& card,
                            double now) {
  std::string text = fmt::format(
      "# Fill in who, when (UTC) and each item, in this order; docs/hardware.md, \"From gantry to person\".\n"
      "schema: {}\nrobot: {}\nwho: \"\"\nwhen: {}\nconfiguration: {}\ncard: {}\nitems:\n",
      kChecklistSchema, dumped(nlohmann::json(robot)), time_text(now), configuration, card);
  for (const ChecklistItem& item : kChecklist)
    text += fmt::format("  # {}\n  {}: {{done: no{}}}\n", item.step, item.name,
                        item.value == ChecklistValue::kNone ? "" : ", value: \"\"");
  return text;
}

Checklist parse_checklist(const std::string& text, const std::string& file) {
  Checklist form;
  const SchemaSection top = read_mapping(file, parse_yaml(text, file), "checklist", checklist_schema(), form);
  top.require_schema(kChecklistSchema);
  form.at = time_of(form.when);
  if (!std::isfinite(form.at))
    top.fail_key("when", fmt::format("expected a time like 2026-11-28T10:15Z, found '{}'", form.when));
  const std::vector<std::string> names = checklist_names();
  std::vector<const char*> keys;
  for (const std::string& name : names) keys.push_back(name.c_str());
  const YamlSection items(file, top.node("items"), "items", keys);
  for (std::size_t k = 0; k < kChecklistItems; ++k) {
    form.answers[k] = read_answer(file, items.node(keys[k]), kChecklist[k]);
    if (k > 0 && form.answers[k].done && !form.answers[k - 1].done)
      items.fail(items.line(keys[k]),
                 fmt::format("item '{}' is done before '{}', which comes first", names[k], names[k - 1]));
  }
  return form;
}

Checklist read_checklist(const std::string& path) { return parse_checklist(read_text(path), path); }

std::string checklist_refusal(const Checklist& form, const ChecklistDemand& demand, const std::string& robot,
                              const std::string& configuration, const std::string& card, double now) {
  const std::string name = fmt::format("checklist '{}'", demand.form);
  const auto short_digest = [](const std::string& digest) { return digest.substr(0, 12); };
  if (form.robot != robot) return fmt::format("{}: expected robot '{}', found '{}'", name, robot, form.robot);
  if (form.configuration != configuration)
    return fmt::format("{}: the configuration has changed since (SHA-256 {}..., the form has {}...)", name,
                       short_digest(configuration), short_digest(form.configuration));
  if (form.card != card)
    return fmt::format("{}: the robot's card has changed since (SHA-256 {}..., the form has {}...)", name,
                       short_digest(card), short_digest(form.card));
  if (now - form.at > 3600.0 * demand.hours)
    return fmt::format("{}: expected one that is at most {:g} h old, found one of {}, {:.1f} h ago", name, demand.hours,
                       form.when, (now - form.at) / 3600.0);
  if (form.at - now > kClocksApart)
    return fmt::format("{}: it is of {}, which is still to come: it is {}", name, form.when, time_text(now));
  for (std::size_t k = 0; k < kChecklistItems; ++k) {
    if (!form.answers[k].done)
      return fmt::format("{}: item '{}' is not done: {}", name, kChecklist[k].name, kChecklist[k].step);
    if (kChecklist[k].name == demand.up_to) break;
  }
  return "";
}

nlohmann::json checklist_json(const Checklist& form) {
  nlohmann::json json = {{"robot", form.robot}, {"who", form.who},
                         {"when", form.when},   {"configuration", form.configuration},
                         {"card", form.card},   {"items", nlohmann::json::array()}};
  for (std::size_t k = 0; k < kChecklistItems; ++k)
    json["items"].push_back(
        {{"name", kChecklist[k].name}, {"done", form.answers[k].done}, {"value", form.answers[k].value}});
  return json;
}

}  // namespace duet
