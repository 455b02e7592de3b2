// A controller asked about itself, without physics: whether it treats left and right alike, how far its targets are
// from its default pose when it stands, how each joint answers a small step of its own.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "duet/controllers/controller.h"
#include "duet/controllers/descriptor.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Makes the controller of a reading of a descriptor, always of the same network.
using ControllerOfReading =
    std::function<std::unique_ptr<Controller>(const Descriptor& descriptor, const ControllerOptions& options)>;

// Controllers of readings over one network's file: networks are made once and used again. Not thread-safe.
ControllerOfReading controllers_of_network(const std::shared_ptr<const RobotModel>& robot, const NetworkMaker& network,
                                           const std::string& network_path);

// A state, a reference and a joint vector seen in a mirror, the plane y = 0.
RobotState mirrored(const RobotModel& robot, const RobotState& state);
Eigen::VectorXd mirrored_joints(const RobotModel& robot, const Eigen::VectorXd& q);

// The same descriptor for the mirrored movement: its clocks half a turn on, or left and right exchanged.
Descriptor with_mirrored_clocks(Descriptor descriptor);

// RMS of the difference between the mirror image of the targets and the targets of the mirror image, over 1.2 s of a
// movement around the neutral pose, as a share of how far the targets move: 0 where left and right are treated alike,
// about 1.4 where the two have nothing in common. Throws as `make`.
double asymmetry(const Descriptor& descriptor, const RobotModel& robot, const ControllerOfReading& make);

// A joint, by name, and how much.
struct JointFigure {
  std::string joint;
  double value = 0.0;
};

// The joint whose first target is furthest from its default angle where the robot stands in its neutral pose and is
// told to stand [rad].
JointFigure farthest_first_target(const Descriptor& descriptor, const RobotModel& robot,
                                  const ControllerOfReading& make);

// The joint whose target follows a step of its own angle by most, as a share of the step: at 1 the joint runs away from
// where it was, as one does whose angle is shown with the wrong sign.
JointFigure strongest_following(const Descriptor& descriptor, const RobotModel& robot, const ControllerOfReading& make);

}  // namespace duet
