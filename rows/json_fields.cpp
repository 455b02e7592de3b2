#include "duet/rows/json_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "duet/core/json.h"
#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {

nlohmann::json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json numbers_or_null(const std::map<std::string, double>& values) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [name, value] : values) json[name] = number_or_null(value);
  return json;
}

nlohmann::json json_of(const Interval& interval) {
  return nlohmann::json::array({number_or_null(interval.low), number_or_null(interval.high)});
}

JsonFields::JsonFields(const nlohmann::json& json, std::string what) : json_(json), what_(std::move(what)) {
  if (!json.is_object()) throw InputError(fmt::format("{}: expected an object, found {}", what_, json.type_name()));
}

const nlohmann::json& JsonFields::at(const std::string& key) {
  asked_.insert(key);
  const auto found = json_.find(key);
  if (found == json_.end()) throw InputError(fmt::format("{}: key '{}' is missing", what_, key));
  return *found;
}

bool JsonFields::has(const std::string& key) {
  asked_.insert(key);
  return json_.contains(key);
}

std::string JsonFields::text(const std::string& key) {
  const nlohmann::json& value = at(key);
  if (!value.is_string()) wrong_type(key, "a string", value);
  return value.get<std::string>();
}

bool JsonFields::boolean(const std::string& key) {
  const nlohmann::json& value = at(key);
  if (!value.is_boolean()) wrong_type(key, "true or false", value);
  return value.get<bool>();
}

std::int64_t JsonFields::integer(const std::string& key) {
  const nlohmann::json& value = at(key);
  if (!value.is_number_integer()) wrong_type(key, "a whole number", value);
  return value.get<std::int64_t>();
}

std::uint64_t JsonFields::unsigned_integer(const std::string& key) {
  const nlohmann::json& value = at(key);
  if (!value.is_number_unsigned()) wrong_type(key, "a whole number of at least 0", value);
  return value.get<std::uint64_t>();
}

int JsonFields::count(const std::string& key) {
  const std::int64_t value = integer(key);
  if (value < 0 || value > std::numeric_limits<int>::max())
    throw InputError(fmt::format("{}: key '{}': expected a whole number of at least 0, found {}", what_, key, value));
  return static_cast<int>(value);
}

double JsonFields::number(const std::string& key) { return number_of(key, at(key), false); }

double JsonFields::number_or_nan(const std::string& key) { return number_of(key, at(key), true); }

const nlohmann::json& JsonFields::list(const std::string& key) {
  const nlohmann::json& value = at(key);
  if (!value.is_array())
    throw InputError(fmt::format("{}: key '{}': expected a list, found {}", what_, key, value.type_name()));
  return value;
}

std::map<std::string, double> JsonFields::numbers(const std::string& key, bool null_is_nan) {
  const nlohmann::json& object = at(key);
  if (!object.is_object()) wrong_type(key, "an object", object);
  std::map<std::string, double> numbers;
  for (const auto& [name, value] : object.items()) {
    numbers[name] = number_of(fmt::format("{}.{}", key, name), value, null_is_nan);
  }
  return numbers;
}

std::map<std::string, bool> JsonFields::booleans(const std::string& key) {
  const nlohmann::json& object = at(key);
  if (!object.is_object()) wrong_type(key, "an object", object);
  std::map<std::string, bool> booleans;
  for (const auto& [name, value] : object.items()) {
    if (!value.is_boolean()) wrong_type(fmt::format("{}.{}", key, name), "true or false", value);
    booleans[name] = value.get<bool>();
  }
  return booleans;
}

std::map<std::string, std::string, std::less<>> JsonFields::texts(const std::string& key) {
  const nlohmann::json& object = at(key);
  if (!object.is_object()) wrong_type(key, "an object", object);
  std::map<std::string, std::string, std::less<>> texts;
  for (const auto& [name, value] : object.items()) {
    if (!value.is_string()) wrong_type(fmt::format("{}.{}", key, name), "a text", value);
    texts.emplace(name, value.get<std::string>());
  }
  return texts;
}

void JsonFields::refuse_unknown() const {
  for (const auto& [key, value] : json_.items()) {
    if (asked_.contains(key)) continue;
    const std::vector<std::string> known(asked_.begin(), asked_.end());
    throw InputError(fmt::format("{}: {}", what_, unknown_name_message("key", key, known)));
  }
}

void JsonFields::wrong_type(const std::string& key, std::string_view expected, const nlohmann::json& found) const {
  constexpr std::size_t kShownValue = 40;
  throw InputError(fmt::format("{}: key '{}': expected {}, found {}", what_, excerpt(key), expected,
                               excerpt(dumped(found), kShownValue)));
}

double JsonFields::number_of(const std::string& key, const nlohmann::json& value, bool null_is_nan) const {
  if (null_is_nan && value.is_null()) return std::numeric_limits<double>::quiet_NaN();
  if (!value.is_number()) wrong_type(key, null_is_nan ? "a number or null" : "a number", value);
  return value.get<double>();
}

namespace {

// A list that nlohmann would convert without a word from other types. `where` names it.
template <typename T, typename Holds>
std::vector<T> checked_list(const nlohmann::json& json, const std::string& where, const char* expected, Holds holds) {
  if (!json.is_array() || !std::all_of(json.begin(), json.end(), holds))
    throw InputError(fmt::format("{}: expected a list of {}", where, expected));
  return json.get<std::vector<T>>();
}

bool is_small_integer(const nlohmann::json& json) {
  if (!json.is_number_integer()) return false;
  const auto value = json.get<double>();
  return std::abs(value) <= std::numeric_limits<int>::max();
}

std::string key_place(const JsonFields& fields, const std::string& key) {
  return fmt::format("{}: key '{}'", fields.what(), key);
}

}  // namespace

nlohmann::json json_value(const std::string& value, bool) { return value; }
nlohmann::json json_value(int value, bool) { return value; }
nlohmann::json json_value(long value, bool) { return value; }
nlohmann::json json_value(std::uint64_t value, bool) { return value; }
nlohmann::json json_value(double value, bool) { return number_or_null(value); }
nlohmann::json json_value(bool value, bool) { return value; }
nlohmann::json json_value(const std::optional<bool>& value, bool) {
  return value.has_value() ? nlohmann::json(*value) : nlohmann::json(nullptr);
}
nlohmann::json json_value(Outcome value, bool) { return std::string(to_string(value)); }
nlohmann::json json_value(const NamedNumbers& values, bool finite) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [name, value] : values)
    if (!finite || std::isfinite(value)) json[name] = number_or_null(value);
  return json;
}
nlohmann::json json_value(const NamedFlags& values, bool) { return values.map(); }
nlohmann::json json_value(const std::vector<std::string>& values, bool) { return values; }
nlohmann::json json_value(const std::vector<int>& values, bool) { return values; }
nlohmann::json json_value(const std::vector<std::vector<int>>& values, bool) { return values; }

void read_value(JsonFields& fields, const std::string& key, bool, std::string& value) { value = fields.text(key); }
void read_value(JsonFields& fields, const std::string& key, bool, int& value) { value = fields.count(key); }
void read_value(JsonFields& fields, const std::string& key, bool, long& value) { value = fields.count(key); }
void read_value(JsonFields& fields, const std::string& key, bool, std::uint64_t& value) {
  value = fields.unsigned_integer(key);
}
void read_value(JsonFields& fields, const std::string& key, bool finite, double& value) {
  value = finite ? fields.number(key) : fields.number_or_nan(key);
}
void read_value(JsonFields& fields, const std::string& key, bool, bool& value) { value = fields.boolean(key); }
void read_value(JsonFields& fields, const std::string& key, bool, std::optional<bool>& value) {
  if (!fields.at(key).is_null()) value = fields.boolean(key);
}
void read_value(JsonFields& fields, const std::string& key, bool, Outcome& value) {
  const std::string name = fields.text(key);
  try {
    value = parse_outcome(name);
  } catch (const std::invalid_argument& error) {
    throw InputError(fmt::format("{}: key '{}': {}", fields.what(), key, error.what()));
  }
}
void read_value(JsonFields& fields, const std::string& key, bool finite, NamedNumbers& values) {
  values = fields.numbers(key, !finite);
}
void read_value(JsonFields& fields, const std::string& key, bool, NamedFlags& values) { values = fields.booleans(key); }
void read_value(JsonFields& fields, const std::string& key, bool, std::vector<std::string>& values) {
  values = checked_list<std::string>(fields.at(key), key_place(fields, key), "names",
                                     [](const nlohmann::json& name) { return name.is_string(); });
}
void read_value(JsonFields& fields, const std::string& key, bool, std::vector<int>& values) {
  values = checked_list<int>(fields.at(key), key_place(fields, key), "whole numbers of 32 bits", is_small_integer);
}
void read_value(JsonFields& fields, const std::string& key, bool, std::vector<std::vector<int>>& values) {
  const nlohmann::json& frames = fields.at(key);
  const std::string place = key_place(fields, key);
  if (!frames.is_array() || frames.empty()) throw InputError(place + ": expected a list of frames");
  for (const nlohmann::json& frame : frames) {
    const std::string where = fmt::format("{}: frame {}", place, values.size());
    values.push_back(checked_list<int>(frame, where, "whole numbers of 32 bits", is_small_integer));
  }
}

std::string_view value_words(ValueType<std::string>, bool) { return "text"; }
std::string_view value_words(ValueType<int>, bool) { return "integer"; }
std::string_view value_words(ValueType<long>, bool) { return "integer"; }
std::string_view value_words(ValueType<std::uint64_t>, bool) { return "integer, 64 bits"; }
std::string_view value_words(ValueType<double>, bool finite) { return finite ? "number" : "number or null"; }
std::string_view value_words(ValueType<bool>, bool) { return "true, false"; }
std::string_view value_words(ValueType<std::optional<bool>>, bool) { return "true, false, null"; }
std::string_view value_words(ValueType<Outcome>, bool) { return "text"; }
std::string_view value_words(ValueType<NamedNumbers>, bool finite) {
  return finite ? "name: number" : "name: number or null";
}
std::string_view value_words(ValueType<NamedFlags>, bool) { return "name: true, false"; }
std::string_view value_words(ValueType<std::vector<std::string>>, bool) { return "list of texts"; }
std::string_view value_words(ValueType<std::vector<int>>, bool) { return "list of integers"; }
std::string_view value_words(ValueType<std::vector<std::vector<int>>>, bool) { return "list of lists of integers"; }

}  // namespace duet
