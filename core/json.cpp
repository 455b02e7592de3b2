#include "duet/core/json.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

constexpr std::size_t kShownReason = 200;

// The library's sentence without its own name and number: "[json.exception.parse_error.101] parse error at ...".
std::string reason(const nlohmann::json::exception& error) {
  const std::string_view sentence = error.what();
  const std::size_t begin = sentence.starts_with('[') ? sentence.find("] ") : std::string_view::npos;
  return shown(begin == std::string_view::npos ? sentence : sentence.substr(begin + 2), kShownReason);
}

}  // namespace

nlohmann::json parse_json(std::string_view text, const std::string& what) {
  using Event = nlohmann::json::parse_event_t;
  const auto check_depth = [&what](int depth, Event event, const nlohmann::json& /*value*/) {
    const bool opens = event == Event::object_start || event == Event::array_start;
    if (opens && depth >= kMostJsonDepth)
      throw InputError(
          fmt::format("{}: expected JSON of at most {} levels, found one that is deeper", what, kMostJsonDepth));
    return true;
  };
  try {
    return nlohmann::json::parse(text, check_depth);
  } catch (const nlohmann::json::exception& error) {
    throw InputError(fmt::format("{}: not valid JSON: {}", what, reason(error)));
  }
}

}  // namespace duet
