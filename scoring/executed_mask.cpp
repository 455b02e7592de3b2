#include "duet/scoring/executed_mask.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdint>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::size_t kRootChannelCount = 7;

}  // namespace

ExecutedMask executed_mask(const RobotModel& robot, const std::vector<int>& joints, bool height) {
  ExecutedMask mask(kRootChannelCount + robot.joints.size(), false);
  mask[0] = mask[1] = mask[3] = mask[6] = true;
  mask[2] = height;
  for (const int joint : joints) mask[kRootChannelCount + static_cast<std::size_t>(joint)] = true;
  return mask;
}

std::string executed_mask_text(const ExecutedMask& mask, const RobotModel& robot) {
  require(mask.size() == kRootChannelCount + robot.joints.size(), "executed channels: expected {} for '{}', found {}",
          kRootChannelCount + robot.joints.size(), robot.name, mask.size());
  std::vector<std::string> left_out;
  for (std::size_t j = 0; j < robot.joints.size(); ++j)
    if (!mask.at(kRootChannelCount + j)) left_out.push_back(robot.joints[j].name);
  return fmt::format("root {}; {} of {} joints, not {}", mask[2] ? "velocity and height" : "velocity",
                     robot.joints.size() - left_out.size(), robot.joints.size(),
                     left_out.empty() ? "any" : fmt::format("{}", fmt::join(left_out, ", ")));
}

void put_executed_mask(const ExecutedMask& mask, Npz& npz) {
  npz.set("executed", std::vector<std::int64_t>(mask.begin(), mask.end()), {mask.size()});
}

std::optional<ExecutedMask> read_executed_mask(const Npz& npz) {
  if (!npz.contains("executed")) return {};
  const std::vector<std::int64_t> values = npz.integers("executed", {-1});
  if (values.size() <= kRootChannelCount)
    throw InputError(fmt::format("'{}': array 'executed': expected more than {} channels, found {}", npz.name(),
                                 kRootChannelCount, values.size()));
  for (const std::int64_t value : values)
    if (value != 0 && value != 1)
      throw InputError(fmt::format("'{}': array 'executed': expected 0 or 1, found {}", npz.name(), value));
  return ExecutedMask(values.begin(), values.end());
}

}  // namespace duet
