#include "duet/retarget/sim_to_real.h"

#include <fmt/format.h>

#include "duet/core/require.h"

namespace duet {

PairedMotion prepare_for_real(PairedMotion motion, const RobotModel& robot, double mild_yaw) {
  constexpr const char* kSetting = "prepared";
  validate(motion);
  require(!motion.settings.contains(kSetting), "paired motion of clip '{}': is prepared already ({})", motion.clip_id,
          motion.settings.contains(kSetting) ? motion.settings.at(kSetting) : "");
  sim_to_real(motion.robot, motion.phases, robot, mild_yaw);
  motion.settings[kSetting] = "sim_to_real";
  motion.settings["mild_yaw"] = fmt::format("{:g}", mild_yaw);
  return motion;
}

}  // namespace duet
