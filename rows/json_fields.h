// Strict reading of JSON objects: each key is named once, a missing, an unknown or a wrongly typed one is an InputError
// that names it. Used by every reader of this room.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>

#include "duet/core/json.h"
#include "duet/statistics/statistics.h"

namespace duet {

// null for a number that is not finite: JSON has no NaN.
nlohmann::json number_or_null(double value);
nlohmann::json numbers_or_null(const std::map<std::string, double>& values);  // an object, likewise
nlohmann::json json_of(const Interval& interval);                             // [low, high]

class JsonFields {
 public:
  // `what` names the object in messages ("episode row", "run.json"). Throws InputError where `json` is no object.
  JsonFields(const nlohmann::json& json, std::string what);

  bool has(const std::string& key);                  // a key that may be absent
  const nlohmann::json& at(const std::string& key);  // throws InputError where it is missing
  std::string text(const std::string& key);
  bool boolean(const std::string& key);
  std::int64_t integer(const std::string& key);
  std::uint64_t unsigned_integer(const std::string& key);
  int count(const std::string& key);             // a whole number of at least 0
  double number(const std::string& key);         // finite by JSON's grammar
  double number_or_nan(const std::string& key);  // null reads as NaN
  const nlohmann::json& list(const std::string& key);
  std::map<std::string, double> numbers(const std::string& key, bool null_is_nan);
  std::map<std::string, bool> booleans(const std::string& key);
  std::map<std::string, std::string, std::less<>> texts(const std::string& key);

  // Throws InputError for a key that nobody asked for, with the nearest known one.
  void refuse_unknown() const;
  [[nodiscard]] const std::string& what() const { return what_; }

 private:
  [[noreturn]] void wrong_type(const std::string& key, std::string_view expected, const nlohmann::json& found) const;
  double number_of(const std::string& key, const nlohmann::json& value, bool null_is_nan) const;

  const nlohmann::json& json_;
  std::string what_;
  std::set<std::string> asked_;
};

}  // namespace duet
