#include "duet/robots/robot_cards.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <system_error>

#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/share.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr const char* kStandsIn = "g1";  // the robot of the paper

// The cards of one share folder, by their place in it.
void add_cards(const std::string& share, std::map<std::string, std::string>& found) {
  std::error_code ignored, error;
  for (const auto& robot : fs::directory_iterator(fs::path(share) / "robots", error)) {
    if (!robot.is_directory(ignored)) continue;
    for (const auto& file : fs::directory_iterator(robot.path(), error)) {
      if (file.path().extension() != ".yaml") continue;
      const fs::path place = fs::path("robots") / robot.path().filename() / file.path().filename();
      found.emplace(place.string(), (fs::path(share) / place).string());
    }
  }
  // A share folder without robots is none of ours; one that cannot be looked into is a fault.
  if (error == std::errc::too_many_files_open || error == std::errc::too_many_files_open_in_system)
    throw MissingError(fmt::format("cannot look for robots in '{}': {}", share, error.message()));
}

void refuse_repeats(const std::vector<RobotCardFile>& cards) {
  for (std::size_t i = 1; i < cards.size(); ++i)
    if (cards[i].name == cards[i - 1].name)
      throw InputError(fmt::format("robot card '{}': expected each name once, found {} and {}", cards[i].name,
                                   cards[i - 1].path, cards[i].path));
}

const RobotCardFile* find_card(const std::vector<RobotCardFile>& cards, const std::string& name) {
  const auto found = std::ranges::find(cards, name, &RobotCardFile::name);
  return found == cards.end() ? nullptr : &*found;
}

}  // namespace

std::vector<RobotCardFile> robot_cards() {
  std::map<std::string, std::string> found;
  for (const std::string& share : share_folders()) add_cards(share, found);
  std::vector<RobotCardFile> cards;
  cards.reserve(found.size());
  for (const auto& [place, path] : found)
    cards.push_back({fs::path(place).stem().string(), fs::path(place).parent_path().string(), path});
  std::ranges::stable_sort(cards, {}, &RobotCardFile::name);
  refuse_repeats(cards);
  std::stable_partition(cards.begin(), cards.end(), [](const RobotCardFile& card) { return card.name == kStandsIn; });
  return cards;
}

std::string shipped_card(const std::string& name) {
  const std::vector<RobotCardFile> cards = robot_cards();
  return entry_named(cards, "robot", name).path;
}

std::string card_path(const std::string& name_or_path) {
  if (name_or_path.ends_with(".yaml")) return name_or_path;
  const std::vector<RobotCardFile> cards = robot_cards();
  if (const RobotCardFile* card = find_card(cards, name_or_path)) return card->path;
  throw MissingError(fmt::format("{} (looked for robots/*/{}.yaml in {})",
                                 unknown_name_message("robot", name_or_path, names_of(cards)), name_or_path,
                                 fmt::join(share_folders(), ", ")));
}

std::string default_robot() { return kStandsIn; }

std::string default_card_path() { return card_path(kStandsIn); }

std::shared_ptr<const RobotModel> robot_of_digest(const std::string& digest) {
  for (const RobotCardFile& card : robot_cards()) {
    try {
      if (auto robot = load_shared_robot(card.path); robot->digest == digest) return robot;
    } catch (const InputError&) {
      continue;  // a broken card is nobody's
    }
  }
  return nullptr;
}

}  // namespace duet
