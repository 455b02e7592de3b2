#include "duet/motion/layouts/joint_names.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/skeleton.h"
#include "duet/core/split.h"
#include "duet/core/text.h"

namespace duet {
namespace {

constexpr std::string_view kSeparators = " _.-|";

std::string after_colon(const std::string& name) {
  const std::size_t colon = name.rfind(':');
  return colon == std::string::npos ? name : name.substr(colon + 1);
}

// A root may be called as the prefix of the others is ("Bip01", "Bip01
// Pelvis").
bool has_prefix(const std::string& name, std::string_view prefix) {
  return name.starts_with(prefix) || name == prefix.substr(0, prefix.size() - 1);
}

// "LeftHand" in quotes or not, without the comment behind it.
std::string plain_value(std::string_view text) {
  text = trimmed(text);
  if (text.size() > 1 && (text.front() == '"' || text.front() == '\''))
    if (const std::size_t end = text.find(text.front(), 1); end != std::string_view::npos)
      return std::string(text.substr(1, end - 1));
  return std::string(trimmed(text.substr(0, text.find(" #"))));
}

}  // namespace

std::vector<std::string> without_prefix(const std::vector<std::string>& names) {
  std::vector<std::string> plain;
  for (const std::string& name : names) plain.push_back(after_colon(name));
  std::string longest;
  for (const std::string& name : plain)
    for (std::size_t at = name.find_first_of(kSeparators); at != std::string::npos;
         at = name.find_first_of(kSeparators, at + 1)) {
      const std::string prefix = name.substr(0, at + 1);
      if (prefix.size() <= longest.size()) continue;
      const auto sharing = std::count_if(plain.begin(), plain.end(),
                                         [&](const std::string& other) { return has_prefix(other, prefix); });
      if (5 * sharing >= 4 * std::ssize(plain)) longest = prefix;
    }
  if (longest.empty()) return plain;
  for (std::string& name : plain)
    if (name.size() > longest.size() && name.starts_with(longest)) name.erase(0, longest.size());
  return plain;
}

std::optional<JointNameMap> parse_joint_name_map(std::string_view text, const std::string& file) {
  if (text.find(':') == std::string_view::npos) return std::nullopt;
  const std::vector<std::string> known(kSmplNames.begin(), kSmplNames.end());
  JointNameMap map;
  std::set<std::string> joints;
  int number = 0;
  for (const std::string_view whole : split(text, '\n')) {
    ++number;
    const std::string_view line = trimmed(whole);
    if (line.empty() || line.front() == '#' || line == "---") continue;
    const auto refuse = [&](const std::string& fault) {
      throw InputError(fmt::format("'{}': line {}: {}", shown(file, kShownSentence), number, fault));
    };
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos) refuse(fmt::format("expected 'left_hip: NAME', found '{}'", shown(line)));
    const std::string joint(trimmed(line.substr(0, colon))), name = plain_value(line.substr(colon + 1));
    if (std::find(known.begin(), known.end(), joint) == known.end())
      refuse(unknown_name_message("joint", joint, known));
    if (name.empty()) refuse(fmt::format("expected the name of '{}' in the motion file, found none", joint));
    if (!joints.insert(joint).second) refuse(fmt::format("joint '{}' is there twice", joint));
    if (!map.emplace(name, joint).second) refuse(fmt::format("'{}' is there twice", shown(name)));
  }
  return map;
}

std::vector<std::string> mapped(const JointNameMap& map, const std::vector<std::string>& names,
                                const std::string& file) {
  std::vector<std::string> joints;
  for (const std::string& name : names) {
    const auto found = map.find(name);
    joints.push_back(found == map.end() ? "" : found->second);
  }
  for (const auto& [name, joint] : map)
    if (std::find(names.begin(), names.end(), name) == names.end())
      throw InputError(
          fmt::format("'{}': no joint '{}', which the skeleton file names as the {}. It "
                      "has: {}",
                      shown(file, kShownSentence), shown(name), joint,
                      shown(fmt::format("{}", fmt::join(names, ", ")), kShownSentence)));
  return joints;
}

}  // namespace duet
