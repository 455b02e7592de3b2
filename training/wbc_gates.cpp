#include "training/wbc_gates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "backends/factory.h"
#include "controllers/wbc_sim/tracker.h"
#include "core/clock.h"
#include "core/recording.h"
#include "metrics/diagnostics.h"
#include "robots/kinematics.h"
#include "training/threads.h"

namespace duet {
namespace {

constexpr double kStep = 0.002;
constexpr double kGateLowest = 0.45, kGateLeastUpright = 0.7,
                 kGateFarthest = 1.0;  // what counts as lost [m], cosine, [m]

WbcGate standing(const std::string& name, double kick, double least, double least_oracle) {
  WbcGate gate{.name = "stand/" + name, .stream = {}, .push_track = ""};
  gate.kick = kick;
  gate.least = least;
  gate.least_oracle = least_oracle;
  return gate;
}

WbcGate walking(const std::string& name, double vx, double vy, double wz, double pause = 0.0) {
  WbcGate gate{.name = "walk/" + name, .stream = {}, .push_track = ""};
  gate.stream.script = ScriptedCommand{.velocity = {vx, vy, wz}, .begin = 1.0, .end = 7.0, .pause = pause};
  gate.least = gate.least_oracle = 0.98;
  return gate;
}

WbcGate pushed(const std::string& name, const std::string& track) {
  WbcGate gate{.name = "push/" + name, .stream = {}, .push_track = track};
  gate.push = 60.0;
  gate.least = gate.least_oracle = 0.95;
  return gate;
}

// One trial as it runs: the engine, the reference, a tracker of its own that tells the clock, and what is measured.
class Trial {
 public:
  Trial(const WbcGate& gate, const std::string& engine, const std::shared_ptr<const RobotModel>& robot,
        Controller& controller, std::uint64_t seed)
      : gate_(gate),
        robot_(robot),
        controller_(controller),
        random_(seed, stream_key({"wbc gate", gate.name})),
        stream_(robot, gate.stream),
        tracker_(robot),
        kinematics_(*robot) {
    Scene scene;
    scene.robot = robot;
    scene.partner = PartnerMode::kNone;
    scene.dt = kStep;
    backend_ = make_backend(engine, scene);
  }

  GateTrial run() {
    start();
    const int ticks = ticks_of(gate_.seconds);
    for (int tick = 0; tick < ticks && alive_; ++tick) advance(tick);
    result_.survived = alive_;
    result_.seconds = kTick * recording_.frames();
    finish();
    return result_;
  }

 private:
  void start() {
    stream_.reset(random_);
    tracker_.reset(stream_.reference());
    RobotState state = robot_->standing_state();
    state.q = tracker_.q();
    try {
      backend_->reset(state);
    } catch (const std::invalid_argument&) {  // the first pose has a hand in the trunk
      backend_->reset(robot_->standing_state());
    }
    controller_.reset(backend_->state());
    command_ = robot_->default_command(robot_->neutral);
    next_kick_ = 2.0;
  }

  void advance(int tick) {
    if (tick > 0) {
      stream_.advance(random_);
      tracker_.update(backend_->state(), stream_.reference());
    }
    controller_.act(backend_->state(), stream_.reference(), command_);
    recording_.robot.push_back(backend_->state());
    recording_.reference.push_back(stream_.reference());
    recording_.q_target.push_back(command_.q_target);
    disturb(tick * kTick);
    Outcome outcome = Outcome::kOk;
    for (int i = 0; i < static_cast<int>(std::lround(kTick / kStep)) && outcome == Outcome::kOk; ++i)
      outcome = backend_->step(command_);
    look();
    const RobotState& state = backend_->state();
    alive_ = outcome == Outcome::kOk && state.X_WB.p.z() > kGateLowest &&
             (state.X_WB.R * Eigen::Vector3d::UnitZ()).z() > kGateLeastUpright &&
             (state.X_WB.p - stream_.reference().X_WB.p).head<2>().norm() < kGateFarthest;
  }

  void disturb(double t) {
    const double direction = random_.uniform(-std::numbers::pi, std::numbers::pi);
    const Eigen::Vector3d along(std::cos(direction), std::sin(direction), 0.0);
    if (gate_.kick > 0.0 && t >= next_kick_) {
      next_kick_ = t + random_.uniform(3.0, 6.0);
      RobotState state = backend_->state();
      state.v_WB += gate_.kick * along;
      backend_->reset(state);
    }
    if (gate_.push <= 0.0) return;
    const int link = robot_->frames[robot_->track_frame(gate_.push_track)].link;
    for (const double begin : {3.0, 6.5}) {
      if (std::abs(t - begin) < 0.5 * kTick) backend_->push(link, gate_.push * along, kinematics_.p_WL(link));
      if (std::abs(t - begin - 1.0) < 0.5 * kTick)
        backend_->push(link, Eigen::Vector3d::Zero(), kinematics_.p_WL(link));
    }
  }

  void look() {
    kinematics_.update(backend_->state().X_WB, backend_->state().q);
    std::array<Eigen::Vector3d, 2> foot;
    std::array<bool, 2> down{};
    std::array<double, 2> height{};
    for (int side = 0; side < 2; ++side) {
      const int link = tracker_.legs()[side].joints().back() + 1;
      foot[side] = kinematics_.p_WL(link);
      height[side] = foot[side].z() - tracker_.ankle_height();
      for (const Contact& contact : backend_->contacts())
        if (contact.side == ContactSide::kGround && contact.link == link) down[side] = true;
      measure_swing(side, height[side]);
    }
    result_.left_height.push_back(static_cast<float>(height[0]));
    result_.right_height.push_back(static_cast<float>(height[1]));
    result_.closest_feet = std::min(result_.closest_feet, (foot[0] - foot[1]).head<2>().norm());
    const Gait& gait = tracker_.gait();
    if (!gait.stepping()) return;
    ++stepping_;
    const bool may_be_down = gait.swing_progress() < 0.15 || gait.swing_progress() > 0.85;
    on_time_ +=
        0.5 * (may_be_down || !down[gait.swing_foot()] ? 1.0 : 0.0) + 0.5 * (down[1 - gait.swing_foot()] ? 1.0 : 0.0);
  }

  // A swing is from where the ankle rises above 1.5 cm until it is below 1 cm again.
  void measure_swing(int side, double height) {
    if (height > 0.015) top_[side] = std::max(top_[side], height);
    if (height > 0.01 || top_[side] == 0.0) return;
    result_.swing_height += top_[side];
    ++result_.swings;
    top_[side] = 0.0;
  }

  void finish() {
    if (result_.swings > 0) result_.swing_height /= result_.swings;
    if (stepping_ > 0) result_.on_time = on_time_ / static_cast<double>(stepping_);
    if (recording_.frames() < 4) return;
    const std::map<std::string, double> found = controller_diagnostics(recording_);
    result_.root_error = found.at("root_error");
    result_.root_angle_deg = found.at("root_angle_error");
    result_.hf_ratio = found.at("hf_ratio");
    result_.dof_jerk = found.at("dof_jerk");
    result_.root_jerk = found.at("root_jerk");
    long count = 0;
    for (int t = 1; t + 1 < recording_.frames(); ++t)
      for (const int joint : tracker_.upper()) {
        const double rate =
            (recording_.reference[t + 1].q[joint] - recording_.reference[t - 1].q[joint]) / (2.0 * kTick);
        result_.joint_error += std::abs(recording_.robot[t].q[joint] - recording_.reference[t].q[joint]);
        result_.joint_rate_error += std::abs(recording_.robot[t].v[joint] - rate);
        ++count;
      }
    result_.joint_error /= static_cast<double>(count);
    result_.joint_rate_error /= static_cast<double>(count);
  }

  const WbcGate& gate_;
  std::shared_ptr<const RobotModel> robot_;
  Controller& controller_;
  Random random_;
  ReferenceStream stream_;
  WbcTracker tracker_;
  Kinematics kinematics_;
  std::unique_ptr<Backend> backend_;
  JointCommand command_;
  Recording recording_;
  GateTrial result_;
  bool alive_ = true;
  double next_kick_ = 2.0, on_time_ = 0.0;
  long stepping_ = 0;
  std::array<double, 2> top_{};
};

void add(GateResult& sum, const GateTrial& trial) {
  ++sum.trials;
  if (!trial.survived) return;
  ++sum.survived;
  GateTrial& mean = sum.mean;
  mean.seconds += trial.seconds;
  mean.root_error += trial.root_error;
  mean.root_angle_deg += trial.root_angle_deg;
  mean.joint_error += trial.joint_error;
  mean.joint_rate_error += trial.joint_rate_error;
  mean.hf_ratio += trial.hf_ratio;
  mean.dof_jerk += trial.dof_jerk;
  mean.root_jerk += trial.root_jerk;
  mean.swing_height += trial.swing_height;
  mean.swings += trial.swings;
  mean.on_time += trial.on_time;
  mean.closest_feet = std::min(mean.closest_feet, trial.closest_feet);
}

}  // namespace

std::vector<WbcGate> wbc_gates() {
  return {standing("kick_0.0", 0.0, 1.0, 1.0),
          standing("kick_0.5", 0.5, 1.0, 1.0),
          standing("kick_1.0", 1.0, 28.0 / 32.0, 30.0 / 32.0),
          walking("forward_0.2", 0.2, 0.0, 0.0),
          walking("forward_0.3", 0.3, 0.0, 0.0),
          walking("forward_0.4", 0.4, 0.0, 0.0),
          walking("back_0.15", -0.15, 0.0, 0.0),
          walking("left_0.15", 0.0, 0.15, 0.0),
          walking("right_0.15", 0.0, -0.15, 0.0),
          walking("turn_left_0.3", 0.0, 0.0, 0.3),
          walking("turn_right_0.3", 0.0, 0.0, -0.3),
          walking("diagonal_left", 0.12, 0.12, 0.0),
          walking("diagonal_right", 0.12, -0.12, 0.0),
          walking("diagonal_back", -0.1, 0.1, 0.0),
          walking("stop_and_go", 0.3, 0.0, 0.0, 1.0),
          pushed("left_hand", "lhand"),
          pushed("right_hand", "rhand"),
          pushed("torso", "torso")};
}

GateTrial run_trial(const WbcGate& gate, const std::string& engine, const std::shared_ptr<const RobotModel>& robot,
                    Controller& controller, std::uint64_t seed) {
  return Trial(gate, engine, robot, controller, seed).run();
}

GateResult run_gate(const WbcGate& gate, const std::string& engine, const std::shared_ptr<const RobotModel>& robot,
                    const ControllerMaker& make, int trials, int threads, std::uint64_t first) {
  std::vector<GateTrial> all(trials);
  on_threads(threads, [&](int thread) {
    const std::unique_ptr<Controller> controller = make();
    for (int i = thread; i < trials; i += threads)
      all[i] = run_trial(gate, engine, robot, *controller, first + static_cast<std::uint64_t>(i));
  });
  GateResult result;
  result.gate = gate.name;
  for (const GateTrial& trial : all) add(result, trial);
  const double n = std::max(1, result.survived);
  for (double* value : {&result.mean.seconds, &result.mean.root_error, &result.mean.root_angle_deg,
                        &result.mean.joint_error, &result.mean.joint_rate_error, &result.mean.hf_ratio,
                        &result.mean.dof_jerk, &result.mean.root_jerk, &result.mean.swing_height, &result.mean.on_time})
    *value /= n;
  return result;
}

}  // namespace duet
