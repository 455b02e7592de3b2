#include "duet/core/plain_name.h"

#include <fmt/format.h>

#include <algorithm>

namespace duet {

bool is_plain_letter(char letter) {
  constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.+-";
  return kLetters.find(letter) != std::string_view::npos;
}

bool is_plain_name(std::string_view name) {
  return !name.empty() && name.front() != '+' && name.front() != '-' && std::ranges::all_of(name, is_plain_letter);
}

std::string plain_name_message(std::string_view name) {
  return fmt::format("expected letters, digits and _ . + - only, none of + and - first, found '{}'", name);
}

}  // namespace duet
