#include "duet/core/plain_name.h"

#include <fmt/format.h>

namespace duet {

bool is_plain_name(std::string_view name) {
  constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.+-";
  return !name.empty() && name.find_first_not_of(kLetters) == std::string_view::npos;
}

std::string plain_name_message(std::string_view name) {
  return fmt::format("expected letters, digits and _ . + - only, found '{}'", name);
}

}  // namespace duet
