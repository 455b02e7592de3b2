// WBC-Sim (supplement A.3.2, A.4.1): a learnt whole-body controller that stands, steps and tracks the 36-D reference.
// The student (1090-D observation with ten frames of history, no base velocity) is the controller; the oracle (163-D,
// with the base velocity that only a simulation has) is there to be compared with.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "duet/controllers/controller.h"
#include "duet/controllers/wbc_sim/observation.h"
#include "duet/controllers/wbc_sim/tracker.h"
#include "duet/core/robot_state.h"
#include "duet/nn/mlp.h"
#include "duet/nn/safetensors.h"
#include "duet/robots/robot_model.h"

namespace duet {

// WBC-Sim's network as it ships: a normaliser and a multilayer perceptron with everything a robot must know to run it,
// in one safetensors file. Names, not indices: joints and observation channels are written out and checked at load, and
// a golden pair of input and output is evaluated.

inline constexpr float kNormalClip = 5.0F;    // of a normalised input
inline constexpr double kActionBound = 4.0;   // of an action, in both directions
inline constexpr double kGoldenError = 1e-4;  // of an output at load

struct WbcNetwork {
  WbcKind kind = WbcKind::kStudent;
  std::string robot;                // name of the card
  std::vector<std::string> joints;  // order of every joint vector
  Eigen::VectorXf mean, deviation;  // input' = clip((input - mean) / deviation, +-5)
  Mlp mlp;
  Eigen::VectorXd action_scale;  // target = base + scale a [rad]
  Eigen::VectorXd neutral;       // that joint angles are relative to [rad]
  GaitOptions gait;              // of the legs that it adds to; its half_width is the card's
  Eigen::VectorXd kp, kd;        // sent with the targets [N m/rad], [N m s/rad]
  std::uint64_t seed = 0;
  long steps = 0;    // of the environment, in training
  std::string note;  // stages, git revision: for people
};

// Evaluates it; keeps a reference. No allocation after construction.
class WbcPolicy {
 public:
  explicit WbcPolicy(const WbcNetwork& network);
  // The action, clipped, for an unscaled observation. Valid until the next call.
  const Eigen::VectorXf& act(std::span<const float> observation);

 private:
  const WbcNetwork& network_;
  MlpRunner runner_;
  Eigen::VectorXf inverse_deviation_, input_, action_;
};

// The weights in `type`, the rest in F32; the golden pair is of the weights as they are stored. Throws
// std::runtime_error where the file cannot be written, std::invalid_argument for sizes that do not fit.
void save_wbc_network(const std::string& path, const WbcNetwork& network, TensorType type);

// Whether a file's header says that it is such a network.
bool is_wbc_network(const SafeTensors& tensors);

// Throws InputError (file, what, expected, found): not a WBC-Sim network, a robot of another name, joints of other
// names or in another order, observation channels other than this program's, shapes that do not fit, numbers that are
// not finite, a golden output that is missed by more than kGoldenError.
WbcNetwork load_wbc_network(const std::string& path, const RobotModel& robot);

// Throws std::invalid_argument for a robot that is not the network's (by joint name) or has not two legs of six joints.
std::unique_ptr<Controller> make_wbc_sim_controller(std::shared_ptr<const RobotModel> robot,
                                                    std::shared_ptr<const WbcNetwork> network);

// Options: network: student | braced | oracle | braced_oracle | a path.
ControllerInfo wbc_sim_info();
std::string wbc_sim_network_path(const ControllerOptions& options);  // MissingError where the shipped one is not there

}  // namespace duet
