// Other readings of an IO descriptor: the same network, understood in another way in one place. An audit asks which of
// them the network behaves better under. Pure functions; thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "duet/controllers/descriptor.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The parts of a contract that a reading changes.
enum class ContractPart {
  kJointOrder,
  kJointSign,
  kActionScale,
  kObservationScale,
  kGyro,
  kGravity,
  kLinearVelocity,
  kPreviousAction,
  kChannelOrder,
  kHistory,
  kClock,
  kCommand,
  kDefaultPose,
  kGains,
  kRate,
  kActionClip,
};

std::string_view to_string(ContractPart part);

struct Reading {
  ContractPart part = ContractPart::kJointOrder;
  std::string said;        // what the network takes it for, after "expects": "the joints in IsaacLab's order"
  int line = 0;            // of the descriptor, where that stands
  bool one_sided = false;  // left and right are treated differently: the network's mirror image tells it
  Descriptor descriptor;
};

// In a fixed order, those of one part side by side; none that says what the descriptor says.
std::vector<Reading> other_readings(const Descriptor& descriptor, const RobotModel& robot);

// Orders in which makers list a robot's joints: the card's, breadth first (IsaacLab), by name, right before left, left
// and right by turns. Names of the robot's joints.
struct JointOrder {
  std::string name;  // "IsaacLab's order (breadth first)"
  std::vector<std::string> joints;
};
std::vector<JointOrder> usual_joint_orders(const RobotModel& robot);

// The descriptor with its entry i being the one that was entry from[i]: joints with their numbers. Entries that the
// network does not move stay.
Descriptor with_joints_permuted(Descriptor descriptor, const std::vector<int>& from);

}  // namespace duet
