#include "duet/core/json.h"

#include <fmt/format.h>

#include <array>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::size_t kShownReason = 200;

// The library's sentence without its own name and number: "[json.exception.parse_error.101] parse error at ...".
std::string reason(const nlohmann::json::exception& error) {
  const std::string_view sentence = error.what();
  const std::size_t begin = sentence.starts_with('[') ? sentence.find("] ") : std::string_view::npos;
  return excerpt(begin == std::string_view::npos ? sentence : sentence.substr(begin + 2), kShownReason);
}

using Event = nlohmann::json::parse_event_t;

// The key that an object of the text has twice; only for a text that is known to have one.
std::string key_given_twice(std::string_view text) {
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  std::string twice;
  const auto note = [&](int /*depth*/, Event event, const nlohmann::json& value) {
    if (event == Event::object_start) keys.emplace_back();
    if (event == Event::object_end) keys.pop_back();
    if (event == Event::key && !keys.back().insert(value.get<std::string>()).second && twice.empty())
      twice = value.get<std::string>();
    return true;
  };
  [[maybe_unused]] const nlohmann::json read = nlohmann::json::parse(text, note);
  return twice;
}

}  // namespace

nlohmann::json parse_json(std::string_view text, const std::string& what) {
  std::array<std::size_t, kMostJsonDepth + 1> keys{};  // how many the object of a depth has so far
  bool has_twice = false;
  const auto check = [&](int depth, Event event, const nlohmann::json& value) {
    const bool opens = event == Event::object_start || event == Event::array_start;
    if (opens && depth >= kMostJsonDepth)
      throw InputError(
          fmt::format("{}: expected JSON of at most {} levels, found one that is deeper", what, kMostJsonDepth));
    const auto level = static_cast<std::size_t>(depth);
    if (event == Event::object_start) keys[level + 1] = 0;
    if (event == Event::key) ++keys[level];
    if (event == Event::object_end && value.size() != keys[level + 1]) has_twice = true;
    return true;
  };
  try {
    nlohmann::json json = nlohmann::json::parse(text, check);
    if (has_twice)
      throw InputError(fmt::format("{}: expected each key of an object once, found '{}' twice", what,
                                   excerpt(key_given_twice(text))));
    return json;
  } catch (const nlohmann::json::exception& error) {
    throw InputError(fmt::format("{}: not valid JSON: {}", what, reason(error)));
  }
}

std::string dumped(const nlohmann::json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string dumped(const nlohmann::ordered_json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace duet
