#include "duet/rollout/perturbations/noise.h"

#include <cmath>

#include "duet/core/random.h"

namespace duet {
namespace {

// Standard deviations of what the controller sees, drawn anew every tick.
struct Noise final : RobotPerturbation {
  Noise() = default;
  Noise(double of_q, double of_v, double of_w, double of_gravity) : q(of_q), v(of_v), w(of_w), gravity(of_gravity) {}

  double q = 0.01;        // [rad]
  double v = 0.5;         // [rad/s]
  double w = 0.2;         // of the base, each axis of B [rad/s]
  double gravity = 0.05;  // turn of the base about its x and y, which is what gravity in B shows of it [rad]

  [[nodiscard]] std::unique_ptr<RobotAct> begin(const RobotModel& robot, std::uint64_t seed) const override;
};

class NoisyView final : public RobotAct {
 public:
  NoisyView(const Noise& deviation, std::uint64_t seed)
      : deviation_(deviation), random_(seed, stream_key({"perturbation", "noise"})) {}

  [[nodiscard]] bool changes_the_view() const override { return true; }
  void see(RobotState& state) override {
    for (double& q : state.q) q += deviation_.q * random_.normal();
    for (double& v : state.v) v += deviation_.v * random_.normal();
    for (double& w : state.w_WB_B) w += deviation_.w * random_.normal();
    const double x = deviation_.gravity * random_.normal(), y = deviation_.gravity * random_.normal();
    const double angle = std::hypot(x, y);
    if (angle > 0.0) state.X_WB.R *= Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d(x, y, 0.0) / angle));
  }

 private:
  Noise deviation_;
  Random random_;
};

std::unique_ptr<RobotAct> Noise::begin(const RobotModel&, std::uint64_t seed) const {
  return std::make_unique<NoisyView>(*this, seed);
}

FieldTable<Noise> noise_table() {
  constexpr FieldRange kDeviation = {0.0, 100.0};
  return {
      field<Noise>({.name = "q", .meaning = "of joint angles", .unit = "rad", .range = kDeviation}, &Noise::q),
      field<Noise>({.name = "v", .meaning = "of joint velocities", .unit = "rad/s", .range = kDeviation}, &Noise::v),
      field<Noise>({.name = "w", .meaning = "of the base's angular velocity", .unit = "rad/s", .range = kDeviation},
                   &Noise::w),
      field<Noise>({.name = "gravity", .meaning = "of the base's tilt", .unit = "rad", .range = kDeviation},
                   &Noise::gravity)};
}

}  // namespace

PerturbationKind noise_kind() {
  return robot_kind<Noise>("noise",
                           "what the controller measures is noisy: standard deviations, drawn every tick; what a "
                           "mapping does not name has none",
                           noise_table(), {0.0, 0.0, 0.0, 0.0});
}

}  // namespace duet
