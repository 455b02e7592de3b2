#include "backends/playback/playback.h"

#include <Eigen/Geometry>

namespace duet {
namespace {

// Angular velocity, in the first frame, of the shorter turn from one orientation to another in `seconds`.
Eigen::Vector3d angular_velocity(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to, double seconds) {
  Eigen::Quaterniond turn = from.conjugate() * to;
  if (turn.w() < 0.0) turn.coeffs() = -turn.coeffs();
  const Eigen::AngleAxisd angle_axis(turn);
  return angle_axis.angle() / seconds * angle_axis.axis();
}

class Playback final : public Backend {
 public:
  explicit Playback(const Scene& scene) : Backend(scene) {
    pending_.q = Eigen::VectorXd::Zero(scene.robot->dof());
    torques_.setZero();
  }

  [[nodiscard]] std::string_view name() const override { return "playback"; }
  [[nodiscard]] std::string version() const override { return "1"; }

 private:
  void do_reset() override {
    has_pending_ = false;
    follows_ = 0;
    steps_since_follow_ = 0;
  }

  void do_set_partner(const HumanJoints&, const HumanJoints&) override {}

  void do_follow(const Reference& reference) override {
    pending_.X_WB = reference.X_WB;
    pending_.q = reference.q;
    has_pending_ = true;
  }

  Outcome do_step(const JointCommand&) override {
    ++steps_since_follow_;
    if (has_pending_) arrive();
    return Outcome::kOk;
  }

  void arrive() {
    const double seconds = steps_since_follow_ * scene().dt;
    if (follows_ == 0) {
      state_.v_WB.setZero();
      state_.w_WB_B.setZero();
      state_.v.setZero();
    } else {
      state_.v_WB = (pending_.X_WB.p - state_.X_WB.p) / seconds;
      state_.w_WB_B = angular_velocity(state_.X_WB.R, pending_.X_WB.R, seconds);
      state_.v = (pending_.q - state_.q) / seconds;
    }
    state_.X_WB = pending_.X_WB;
    state_.q = pending_.q;
    has_pending_ = false;
    ++follows_;
    steps_since_follow_ = 0;
  }

  void do_push(int, const Eigen::Vector3d&, const Eigen::Vector3d&) override {}

  void do_snapshot(Snapshot& snapshot) const override {
    std::vector<double>& values = snapshot.values;
    values.insert(values.end(),
                  {has_pending_ ? 1.0 : 0.0, static_cast<double>(follows_), static_cast<double>(steps_since_follow_)});
    values.insert(values.end(), pending_.X_WB.p.data(), pending_.X_WB.p.data() + 3);
    values.insert(values.end(), pending_.X_WB.R.coeffs().data(), pending_.X_WB.R.coeffs().data() + 4);
    values.insert(values.end(), pending_.q.data(), pending_.q.data() + pending_.q.size());
  }

  void do_restore(std::span<const double> values) override {
    has_pending_ = values[0] != 0.0;
    follows_ = static_cast<long>(values[1]);
    steps_since_follow_ = static_cast<long>(values[2]);
    pending_.X_WB.p = Eigen::Vector3d(values.data() + 3);
    pending_.X_WB.R.coeffs() = Eigen::Vector4d(values.data() + 6);
    pending_.q = Eigen::Map<const Eigen::VectorXd>(values.data() + 10, pending_.q.size());
  }

  Reference pending_;
  bool has_pending_ = false;
  long follows_ = 0;
  long steps_since_follow_ = 0;
};

}  // namespace

std::unique_ptr<Backend> make_playback_backend(const Scene& scene) { return std::make_unique<Playback>(scene); }

}  // namespace duet
