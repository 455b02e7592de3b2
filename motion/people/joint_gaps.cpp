#include "duet/motion/people/joint_gaps.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

[[noreturn]] void refuse_gap(const RawPeople& people, int who, int frame, int joint, const std::string& fault) {
  throw InputError(fmt::format("'{}': person {}, frame {}, joint '{}': {}", shown(people.name, kShownSentence),
                               who == 0 ? "A" : "B", frame, shown(people.layout->names[joint]), fault));
}

bool all_finite(const PointTracks& joints) {
  std::size_t others = 0;
  for (const double value : joints.data()) others += std::abs(value) <= std::numeric_limits<double>::max() ? 0 : 1;
  return others == 0;
}

// Frames [begin, end) between two that are seen.
void fill(PointTracks& joints, int joint, int begin, int end) {
  const Eigen::Vector3d before = joints.at(begin - 1, joint), after = joints.at(end, joint);
  for (int t = begin; t < end; ++t)
    joints.at(t, joint) = before + (after - before) * (t - begin + 1.0) / (end - begin + 1.0);
}

struct Filled {
  int gaps = 0, values = 0, longest = 0;  // [frames]
};

void fill_joint(const RawPeople& people, int who, int joint, double rate_hz, PointTracks& joints, Filled& count) {
  const int frames = joints.frames();
  const auto seen = [&](int t) { return joints.at(t, joint).allFinite(); };
  for (int t = 0; t < frames; ++t) {
    if (seen(t)) continue;
    if (joints.at(t, joint).array().isInf().any()) refuse_gap(people, who, t, joint, "the position is infinite");
    if (!people.layout->has_gaps) refuse_gap(people, who, t, joint, "the position is not a number");
    int end = t;
    while (end < frames && !seen(end)) ++end;
    if (t == 0 || end == frames)
      refuse_gap(people, who, t, joint, fmt::format("not seen at the {} of the recording", t == 0 ? "begin" : "end"));
    if (!(rate_hz > 0.0) || end - t > kLongestGap * rate_hz)
      refuse_gap(people, who, t, joint,
                 fmt::format("not seen for {} frames, expected at most {} s", end - t, kLongestGap));
    fill(joints, joint, t, end);
    ++count.gaps;
    count.values += end - t;
    count.longest = std::max(count.longest, end - t);
    t = end;
  }
}

// Columns that some SMPL joint is made of; what the others hold is not looked at.
std::vector<bool> used_columns(const JointLayout& layout) {
  std::vector<bool> used(layout.names.size(), false);
  const auto use = [&](const std::vector<JointRecipe::Part>& parts) {
    for (const JointRecipe::Part& part : parts)
      if (part.column < static_cast<int>(used.size())) used[part.column] = true;
  };
  for (const JointRecipe& recipe : layout.smpl) use(recipe.parts), use(recipe.toward);
  use(layout.face);
  return used;
}

}  // namespace

std::string fill_gaps(const RawPeople& people, double rate_hz, std::optional<RawPeople>& filled) {
  if (all_finite(people.joints[0]) && all_finite(people.joints[1])) return "";
  RawPeople copy = people;
  Filled count;
  const std::vector<bool> used = used_columns(*people.layout);
  for (const int who : {0, 1})
    for (int joint = 0; joint < people.joints[who].points(); ++joint)
      if (used[joint]) fill_joint(people, who, joint, rate_hz, copy.joints[who], count);
  if (count.gaps == 0) return "";
  filled = std::move(copy);
  return fmt::format("gaps: {} stretches of a joint not seen, {} positions, the longest {} frames, filled along lines",
                     count.gaps, count.values, count.longest);
}

}  // namespace duet
