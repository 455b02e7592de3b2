#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>

#include "duet/controllers/descriptor_controller.h"
#include "duet/controllers/metadata.h"
#include "duet/core/require.h"

namespace duet {

std::vector<std::string> metadata_words(const std::string& text) {
  std::vector<std::string> words;
  std::string word;
  for (const char c : text + ",") {
    const bool apart = std::string_view(",;[](){}\"'").find(c) != std::string_view::npos ||
                       std::isspace(static_cast<unsigned char>(c)) != 0;
    if (!apart) word += c;
    if (apart && !word.empty()) words.push_back(std::exchange(word, {}));
  }
  return words;
}

std::string plain_joint(std::string name) {
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return c == '-' ? '_' : std::tolower(c); });
  for (const std::string_view end : {"_joint", "_link"})
    if (name.ends_with(end)) name.erase(name.size() - end.size());
  return name;
}

namespace {

using Words = std::vector<std::string>;

// A key as any of the makers spells it.
constexpr std::string_view kJointKeys[] = {"joint_names",          "dof_names",          "joint_order",
                                           "actuated_joint_names", "policy_joint_names", "action_joint_names"};
constexpr std::string_view kStiffnessKeys[] = {"joint_stiffness", "kp", "kps", "stiffness", "p_gains"};
constexpr std::string_view kDampingKeys[] = {"joint_damping", "kd", "kds", "damping", "d_gains"};
constexpr std::string_view kPoseKeys[] = {"default_joint_pos",    "default_joint_positions", "default_dof_pos",
                                          "default_joint_angles", "default_dof_angles",      "default_angles"};
constexpr std::string_view kScaleKeys[] = {"action_scale", "action_scales"};

constexpr double kMetadataRounding = 6.0e-4, kMetadataShare = 0.01;  // of numbers that agree: 3 decimals, and 1 %

struct MetadataEntry {
  std::string key;
  Words words;
};

template <std::size_t N>
std::optional<MetadataEntry> find_metadata(const Metadata& metadata, const std::string_view (&keys)[N]) {
  for (const std::string_view key : keys)
    for (const auto& [name, text] : metadata) {
      std::string lower = name;
      std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return std::tolower(c); });
      if (lower == key) return MetadataEntry{name, metadata_words(text)};
    }
  return std::nullopt;
}

Words plain_joints(Words names) {
  for (std::string& name : names) name = plain_joint(name);
  return names;
}

class FactComparison {
 public:
  FactComparison(const Descriptor& descriptor, const Metadata& metadata, const std::string& path)
      : descriptor_(descriptor), metadata_(metadata), path_(path) {}

  std::vector<std::string> compare() {
    find_joints();
    compare_numbers(kStiffnessKeys, "kp", [](const DescriptorJoint& joint) { return std::optional(joint.kp); });
    compare_numbers(kDampingKeys, "kd", [](const DescriptorJoint& joint) { return std::optional(joint.kd); });
    compare_numbers(kPoseKeys, "default", [](const DescriptorJoint& joint) { return std::optional(joint.neutral); });
    compare_numbers(kScaleKeys, "action", [](const DescriptorJoint& joint) { return joint.action; });
    if (!order_.empty())
      throw InputError(fmt::format("{}{}{}", order_, notes_.empty() ? "" : "; ", fmt::join(notes_, "; ")));
    return std::move(notes_);
  }

 private:
  // The descriptor's joints that the file's list is of: those that the network moves, or all.
  [[nodiscard]] std::vector<const DescriptorJoint*> joints_of(std::size_t count) const {
    std::vector<const DescriptorJoint*> all, moved;
    for (const DescriptorJoint& joint : descriptor_.joints) {
      all.push_back(&joint);
      if (joint.action) moved.push_back(&joint);
    }
    return moved.size() == count ? moved : all;
  }

  void find_joints() {
    const std::optional<MetadataEntry> entry = find_metadata(metadata_, kJointKeys);
    if (!entry || entry->words.empty()) return;
    names_ = plain_joints(entry->words);
    const std::vector<const DescriptorJoint*> joints = joints_of(names_.size());
    Words own;
    for (const DescriptorJoint* joint : joints) own.push_back(plain_joint(joint->name));
    if (own == names_) return;
    Words a = own, b = names_;
    std::ranges::sort(a);
    std::ranges::sort(b);
    if (a == b) {
      const auto place = static_cast<std::size_t>(std::ranges::mismatch(own, names_).in1 - own.begin());
      order_ = fmt::format(
          "{}: controller '{}': joint {} is '{}', in '{}' of {} it is '{}': the same joints in another order; put them "
          "in "
          "the network's",
          descriptor_.file, descriptor_.name, place + 1, joints[place]->name, entry->key, path_,
          excerpt(entry->words[place]));
    } else {
      const auto other = std::ranges::find_if(
          names_, [&](const std::string& name) { return std::ranges::find(own, name) == own.end(); });
      const auto at = static_cast<std::size_t>(other == names_.end() ? 0 : other - names_.begin());
      say(fmt::format("'{}' of {} names {} joints, '{}' among them; the descriptor has {} others", entry->key, path_,
                      names_.size(), excerpt(entry->words[at]), own.size()));
      names_.clear();
      names_differ_ = true;
    }
  }

  template <std::size_t N, typename ValueOf>
  void compare_numbers(const std::string_view (&keys)[N], const char* own, const ValueOf& value_of) {
    const std::optional<MetadataEntry> entry = find_metadata(metadata_, keys);
    if (!entry || entry->words.empty() || names_differ_) return;
    const bool one = entry->words.size() == 1;
    const std::size_t count = one ? (names_.empty() ? descriptor_.joints.size() : names_.size()) : entry->words.size();
    const std::vector<const DescriptorJoint*> joints = joints_of(count);
    if (joints.size() != count) return;
    int others = 0;
    std::string first;
    for (std::size_t i = 0; i < count; ++i) {
      const DescriptorJoint* const joint = named(i, joints);
      const std::optional<double> theirs = parse_number(entry->words[one ? 0 : i]);
      const std::optional<double> ours = joint == nullptr ? std::nullopt : value_of(*joint);
      if (!theirs || !ours || std::abs(*theirs - *ours) <= kMetadataRounding + kMetadataShare * std::abs(*theirs))
        continue;
      if (++others == 1)
        first = fmt::format("{:g} for '{}', the descriptor's '{}' is {:g}", *theirs, joint->name, own, *ours);
    }
    if (others > 0)
      say(fmt::format("'{}' of {} is {}{}", entry->key, path_, first,
                      others > 1 ? fmt::format(", and {} joints more differ", others - 1) : ""));
  }

  // The joint of the file's place i: by its name where the file has names.
  [[nodiscard]] const DescriptorJoint* named(std::size_t i, const std::vector<const DescriptorJoint*>& joints) const {
    if (names_.size() != joints.size()) return joints[i];
    for (const DescriptorJoint* joint : joints)
      if (plain_joint(joint->name) == names_[i]) return joint;
    return nullptr;
  }

  void say(const std::string& sentence) {
    notes_.push_back(fmt::format("{}: controller '{}': {}", descriptor_.file, descriptor_.name, sentence));
  }

  const Descriptor& descriptor_;
  const Metadata& metadata_;
  const std::string& path_;
  Words names_;  // of the file, plain; empty where it has none or others
  bool names_differ_ = false;
  std::string order_;
  std::vector<std::string> notes_;
};

}  // namespace

std::vector<std::string> compare_with_network(const Descriptor& descriptor, const Metadata& metadata,
                                              const std::string& network_path) {
  return FactComparison(descriptor, metadata, network_path).compare();
}

}  // namespace duet
