#include "duet/retarget/joint_speeds.h"

#include <algorithm>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kShareOfLimit = 0.99;  // so that a file's rounding does not lift a speed over its limit

// The highest sequence that is nowhere above `q` and rises or falls by at most `step` a frame.
Eigen::RowVectorXd below(Eigen::RowVectorXd q, double step) {
  for (Eigen::Index t = 1; t < q.size(); ++t) q[t] = std::min(q[t], q[t - 1] + step);
  for (Eigen::Index t = q.size() - 1; t > 0; --t) q[t - 1] = std::min(q[t - 1], q[t] + step);
  return q;
}

}  // namespace

void keep_joint_speeds(const RobotModel& robot, RobotMotion& motion) {
  require(motion.q.rows() == robot.dof(), "joint speeds: expected a motion of this robot");
  for (int j = 0; j < robot.dof(); ++j) {
    const double step = kShareOfLimit * robot.joints[static_cast<std::size_t>(j)].velocity / motion.rate_hz;
    const Eigen::RowVectorXd q = motion.q.row(j);
    if (step <= 0.0 || q.size() < 2) continue;
    if ((q.tail(q.size() - 1) - q.head(q.size() - 1)).cwiseAbs().maxCoeff() <= step) continue;
    motion.q.row(j) = 0.5 * (below(q, step) - below(-q, step));
  }
}

}  // namespace duet
