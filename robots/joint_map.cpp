#include "duet/robots/joint_map.h"

#include <algorithm>
#include <utility>

#include "duet/core/require.h"

namespace duet {

JointMap::JointMap(const std::vector<std::string>& from, const RobotModel& to) : neutral_(to.neutral) {
  for (const std::string& name : to.joint_names()) {
    const auto found = std::find(from.begin(), from.end(), name);
    source_.push_back(found == from.end() ? -1 : static_cast<int>(found - from.begin()));
  }
  const bool common = std::ranges::any_of(source_, [](int joint) { return joint >= 0; });
  require(common || from.empty() || source_.empty(),
          "expected a motion with joints of robot '{}' ('{}', ...), found one of '{}', ...", to.name,
          source_.empty() ? "" : to.joints.front().name, from.empty() ? "" : from.front());
}

Eigen::VectorXd JointMap::fill(const Eigen::VectorXd& values, Eigen::VectorXd filled) const {
  for (std::size_t j = 0; j < source_.size(); ++j)
    if (source_[j] >= 0) filled[static_cast<Eigen::Index>(j)] = values[source_[j]];
  return filled;
}

Eigen::VectorXd JointMap::rates(const Eigen::VectorXd& v) const {
  return fill(v, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(source_.size())));
}

RobotState JointMap::state(const RobotState& state) const {
  RobotState moved = state;
  moved.q = positions(state.q);
  moved.v = rates(state.v);
  return moved;
}

RobotMotion on_body(const RobotMotion& motion, const RobotModel& body) {
  if (motion.joint_names == body.joint_names()) return motion;
  const JointMap map(motion.joint_names, body);
  RobotMotion moved{motion.rate_hz, body.joint_names(), motion.root, Eigen::MatrixXd(body.dof(), motion.frames())};
  for (int t = 0; t < motion.frames(); ++t) moved.q.col(t) = map.positions(motion.q.col(t));
  return moved;
}

}  // namespace duet
