#include "bench/robot_cards.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>

#include "core/names.h"

namespace duet {

std::vector<std::string> shipped_cards() {
  std::vector<std::string> cards = {default_card_path()};
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(cards.front()).parent_path()))
    if (entry.path().extension() == ".yaml" && entry.path() != cards.front()) cards.push_back(entry.path().string());
  std::sort(cards.begin() + 1, cards.end());
  return cards;
}

std::string shipped_card(const std::string& name) {
  std::vector<std::string> names;
  for (const std::string& card : shipped_cards()) {
    names.push_back(std::filesystem::path(card).stem().string());
    if (names.back() == name) return card;
  }
  throw std::invalid_argument(unknown_name_message("robot", name, names));
}

std::shared_ptr<const RobotModel> robot_of_digest(const std::string& digest) {
  for (const std::string& card : shipped_cards())
    if (auto robot = load_shared_robot(card); robot->digest == digest) return robot;
  return nullptr;
}

}  // namespace duet
