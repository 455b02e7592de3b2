// A controller of one's own, found by name like those that ship, driven for two seconds in an engine.
#include <fmt/format.h>

#include <cmath>
#include <exception>
#include <memory>
#include <string>
#include <utility>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/rollout/rollout.h"

namespace {

// The card's gains, and ankles that lean against the tilt of the pelvis.
class AnkleController final : public duet::Controller {
 public:
  AnkleController(std::shared_ptr<const duet::RobotModel> robot, double gain)
      : robot_(std::move(robot)),
        gains_(robot_->default_command(robot_->neutral)),
        ankles_{robot_->joint_index("left_ankle_pitch_joint"), robot_->joint_index("right_ankle_pitch_joint")},
        gain_(gain) {}

  [[nodiscard]] std::string_view name() const override { return "ankles"; }
  void reset(const duet::RobotState&) override {}

  void act(const duet::RobotState& state, const duet::Reference& reference, duet::JointCommand& command) override {
    command = gains_;
    command.q_target = reference.q;
    const Eigen::Vector3d up = state.X_WB.R.conjugate() * Eigen::Vector3d::UnitZ();
    const double pitch = std::atan2(-up.x(), up.z());
    for (const int ankle : ankles_) command.tau_ff[ankle] += gain_ * (pitch + 0.1 * state.w_WB_B.y());
  }

 private:
  std::shared_ptr<const duet::RobotModel> robot_;
  duet::JointCommand gains_;
  int ankles_[2];
  double gain_;  // [N m/rad]
};

void add_ankle_controller() {
  duet::register_controller({.name = "ankles",
                             .about = "The card's gains, and ankles that lean against the tilt of the pelvis",
                             .robot = "g1",
                             .walks = false,
                             .options = {{"gain", "150", "torque of each ankle per tilt [N m/rad]"}}},
                            [](std::shared_ptr<const duet::RobotModel> robot, const duet::ControllerOptions& options) {
                              const auto gain = options.find("gain");
                              return std::make_unique<AnkleController>(
                                  std::move(robot), gain == options.end() ? 150.0 : std::stod(gain->second));
                            });
}

struct Run {
  double seconds = 0.0;  // until it fell, or two
  double height = 0.0;   // of the pelvis at the end [m]
};

// Standing still for two seconds: an episode as duet's benchmark runs them, led by a motion of one frame.
Run stand(const std::string& engine, const std::string& controller_name) {
  duet::Scene scene;
  scene.robot = duet::load_shared_robot(duet::controller_info(controller_name).robot);
  scene.partner = duet::PartnerMode::kNone;
  const auto backend = duet::make_backend(engine, scene);
  const auto controller = duet::make_controller(controller_name, scene.robot);
  duet::Episode episode;
  episode.start = scene.robot->standing_state();
  episode.ticks = 100;
  episode.fall = scene.robot->fall;
  const duet::RobotMotion still = {50.0, scene.robot->joint_names(), {episode.start.X_WB}, episode.start.q};
  duet::MotionReference source(still);
  const duet::Recording recording = duet::roll_out(episode, *backend, *controller, source).recording;
  return {recording.frames() / recording.rate_hz, backend->state().X_WB.p.z()};
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2) {
    fmt::print(stderr, "usage: my_controller ENGINE\n");
    return 2;
  }
  add_ankle_controller();
  for (const char* name : {"pd", "ankles"}) {
    const Run run = stand(argv[1], name);
    fmt::print("{} in {}: {:.2f} s, pelvis at {:.3f} m\n", name, argv[1], run.seconds, run.height);
  }
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "my_controller: {}\n", error.what());
  return 2;
}
