#include "duet/people/bvh/bvh_people.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "duet/core/require.h"
#include "duet/people/bvh/bvh_skeleton.h"

namespace duet {
namespace {

constexpr int kFewestJoints = 12;  // of a person: limbs and a head

class BranchFinder {
 public:
  explicit BranchFinder(const Bvh& bvh) : bvh_(bvh), sizes_(bvh.joints.size(), 1) {
    for (std::size_t j = bvh.joints.size(); j-- > 0;)
      if (bvh.joints[j].parent >= 0) sizes_[bvh.joints[j].parent] += sizes_[j];
  }

  // Branches below a joint (-1: the roots) that may be people.
  [[nodiscard]] std::vector<int> branches(int parent) const {
    std::vector<int> found;
    for (std::size_t j = 0; j < sizes_.size(); ++j)
      if (bvh_.joints[j].parent == parent && sizes_[j] >= kFewestJoints) found.push_back(static_cast<int>(j));
    return found;
  }

  // The branch with the joints above it.
  [[nodiscard]] Bvh cut(int top) const {
    std::vector<bool> kept(sizes_.size(), false);
    for (int j = top; j >= 0; j = bvh_.joints[j].parent) kept[j] = true;
    for (std::size_t j = top + 1; j < sizes_.size(); ++j)
      if (bvh_.joints[j].parent >= top) kept[j] = kept[j] || kept[bvh_.joints[j].parent];
    return with(kept);
  }

 private:
  [[nodiscard]] Bvh with(const std::vector<bool>& kept) const {
    Bvh person{.name = bvh_.name, .joints = {}, .frame_time = bvh_.frame_time, .frames = bvh_.frames, .values = {}};
    person.notes = bvh_.notes;
    std::vector<int> place(kept.size(), -1);
    std::vector<bool> columns;
    for (std::size_t j = 0; j < kept.size(); ++j) {
      columns.insert(columns.end(), bvh_.joints[j].channels.size(), kept[j]);
      if (!kept[j]) continue;
      place[j] = static_cast<int>(person.joints.size());
      person.joints.push_back(bvh_.joints[j]);
      int& parent = person.joints.back().parent;
      if (parent >= 0) parent = place[parent];
    }
    for (std::size_t i = 0; i < bvh_.values.size(); ++i)
      if (columns[i % columns.size()]) person.values.push_back(bvh_.values[i]);
    return person;
  }

  const Bvh& bvh_;
  std::vector<int> sizes_;  // of the branch of each joint, itself included
};

bool is_person(const Bvh& bvh, const std::string& names) {
  try {
    (void)find_smpl_joints(bvh, names);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

}  // namespace

std::array<Bvh, 2> two_people_in(const Bvh& bvh, const std::string& names) {
  const BranchFinder finder(bvh);
  std::vector<int> level = finder.branches(-1);
  while (!level.empty()) {
    std::vector<Bvh> people;
    if (level.size() > 1)
      for (const int top : level)
        if (Bvh branch = finder.cut(top); is_person(branch, names)) people.push_back(std::move(branch));
    if (people.size() == 2) return {std::move(people[0]), std::move(people[1])};
    if (level.size() > 1) break;
    level = finder.branches(level.front());
  }
  throw InputError(
      fmt::format("'{}': expected two people in one BVH file, or a pair of files, one a "
                  "person; found {}",
                  bvh.name, is_person(bvh, names) ? "one person" : "nobody whose joints are known"));
}

}  // namespace duet
