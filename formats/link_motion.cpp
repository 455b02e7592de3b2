#include "duet/formats/link_motion.h"

#include <algorithm>
#include <cmath>

#include "duet/robots/kinematics.h"

namespace duet {

Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& R) {
  const double sign = R.w() < 0.0 ? -1.0 : 1.0;
  const double sine = R.vec().norm();
  constexpr double kSmall = 1e-9;  // below it the angle is twice the vector part to the last bit
  if (sine < kSmall) return 2.0 * sign * R.vec();
  return (2.0 * sign * std::atan2(sine, sign * R.w()) / sine) * R.vec();
}

Eigen::MatrixXd rate_of_change(const Eigen::MatrixXd& values, double rate_hz) {
  const Eigen::Index frames = values.cols();
  Eigen::MatrixXd rate(values.rows(), frames);
  for (Eigen::Index t = 0; t < frames; ++t) {
    const Eigen::Index before = std::max<Eigen::Index>(t - 1, 0), after = std::min(t + 1, frames - 1);
    rate.col(t) = (values.col(after) - values.col(before)) * (rate_hz / static_cast<double>(after - before));
  }
  return rate;
}

Eigen::MatrixXd angular_velocity(const std::vector<Eigen::Quaterniond>& R_WB, double rate_hz) {
  const auto frames = static_cast<Eigen::Index>(R_WB.size());
  Eigen::MatrixXd w(3, frames);
  for (Eigen::Index t = 0; t < frames; ++t) {
    const Eigen::Index middle = std::clamp<Eigen::Index>(t, 1, std::max<Eigen::Index>(frames - 2, 1));
    const Eigen::Index after = std::min(middle + 1, frames - 1);
    const Eigen::Quaterniond turn =
        R_WB[static_cast<std::size_t>(after)] * R_WB[static_cast<std::size_t>(middle - 1)].conjugate();
    w.col(t) = rotation_vector(turn) * (rate_hz / static_cast<double>(after - middle + 1));
  }
  return w;
}

LinkMotion link_motion(const RobotModel& robot, const RobotMotion& motion, const std::vector<int>& links) {
  const auto bodies = static_cast<Eigen::Index>(links.size()), frames = static_cast<Eigen::Index>(motion.frames());
  LinkMotion result;
  result.position.resize(3 * bodies, frames);
  result.quat_wxyz.resize(4 * bodies, frames);
  result.angular_velocity.resize(3 * bodies, frames);
  std::vector<std::vector<Eigen::Quaterniond>> rotations(links.size());
  Kinematics kinematics(robot);
  for (int t = 0; t < motion.frames(); ++t) {
    kinematics.update(motion.root[static_cast<std::size_t>(t)], motion.q.col(t));
    for (Eigen::Index b = 0; b < bodies; ++b) {
      const Pose X_WL = kinematics.X_WL(links[static_cast<std::size_t>(b)]);
      result.position.block<3, 1>(3 * b, t) = X_WL.p;
      result.quat_wxyz.block<4, 1>(4 * b, t) << X_WL.R.w(), X_WL.R.x(), X_WL.R.y(), X_WL.R.z();
      rotations[static_cast<std::size_t>(b)].push_back(X_WL.R);
    }
  }
  result.velocity = rate_of_change(result.position, motion.rate_hz);
  for (Eigen::Index b = 0; b < bodies; ++b)
    result.angular_velocity.middleRows<3>(3 * b) =
        angular_velocity(rotations[static_cast<std::size_t>(b)], motion.rate_hz);
  return result;
}

}  // namespace duet
