// A recorded trace of a controller's own program: what it sensed, what it was told, what its network was shown and what
// it answered; and whether a descriptor over the same network gives the same. Format: docs/file-formats.md,
// "Controller trace".
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "duet/controllers/descriptor.h"
#include "duet/controllers/root_conversion.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/robots/robot_model.h"

namespace duet {

inline constexpr double kTraceTolerance = 1e-5;  // of numbers up to 1, and their share above

// Rows are the network's acts in order, from the start of an episode. Matrices without columns: the file has none.
struct ControllerTrace {
  std::string file;
  std::vector<RobotState> states;
  std::vector<VelocityCommand> commands;
  Eigen::MatrixXd observations;  // rows x numbers of the network's first input
  Eigen::MatrixXd actions;       // rows x actions, as the network puts them out
  Eigen::MatrixXd targets;       // rows x joints that the network moves, in the descriptor's order [rad]

  [[nodiscard]] int rows() const { return static_cast<int>(states.size()); }
};

// A CSV file with a header, or an NPZ archive (by its content). Throws InputError naming file, line or array, expected
// and found: a column that is missing or twice, numbers that are not finite, a quaternion that is not unit, a
// descriptor that is not told a velocity.
ControllerTrace read_controller_trace(const std::string& path, const Descriptor& descriptor, const RobotModel& robot);
// `name` stands in messages.
ControllerTrace parse_controller_trace(const std::string& bytes, const std::string& name, const Descriptor& descriptor,
                                       const RobotModel& robot);

// Largest differences over all rows; 0 for what the trace does not have.
struct TraceAgreement {
  double observation = 0.0, action = 0.0, target = 0.0;
  bool equal = false;                 // all within kTraceTolerance
  std::string first;                  // sentence: where the two part first; "" where they do not
  std::vector<std::string> patterns;  // sentences: what the observation's differences are made of, channel by channel
};

// Shows the descriptor's controller the trace's states and commands, act by act. Throws InputError as
// make_descriptor_controller; and for a controller that acts more often than 50 Hz and is told changing velocities.
TraceAgreement compare_with_trace(const Descriptor& descriptor, const std::shared_ptr<const RobotModel>& robot,
                                  const NetworkMaker& network, const std::string& network_path,
                                  const ControllerTrace& trace);

// The numbers that the descriptor's controller shows its network on the trace's states and commands, as ControllerTrace
// has it.
Eigen::MatrixXd observations_of_trace(const Descriptor& descriptor, const std::shared_ptr<const RobotModel>& robot,
                                      const NetworkMaker& network, const std::string& network_path,
                                      const ControllerTrace& trace);

}  // namespace duet
