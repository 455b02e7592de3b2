// A number that somebody typed.
#pragma once

#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

namespace duet {

// The finite number that the whole text is, in the C locale; nothing where it is none.
inline std::optional<double> parse_number(std::string_view text) {
  double value = 0.0;
  const char* const last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, value);
  if (error != std::errc() || end != last || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace duet
