// An engine that steps as another one, but for one fault of its contacts or for what it declares: a module built for
// tests/app/fault_test.cpp. Its options name the engine and the fault.
#include "duet/backends/engine_module.h"

namespace duet {
namespace {

const EngineOption kOptions[] = {
    choice_option("engine", {"mujoco", "bullet", "dart", "ode", "simbody"}, "that it steps as"),
    choice_option("fault", {"none", "deaf", "slick", "slick_self"},
                  "deaf: the partner's skin has no velocity; slick: no friction on the partner; slick_self: none "
                  "between links")};

Scene scene_of(Scene scene) {
  const std::string fault = option_choice(scene.options, kOptions, "fault");
  if (fault == "slick") scene.friction.robot_human = 0.0;
  if (fault == "slick_self") scene.friction.robot_robot = 0.0;
  scene.options.clear();
  return scene;
}

class AlteredBackend final : public Backend {
 public:
  explicit AlteredBackend(const Scene& scene)
      : Backend(scene),
        deaf_(option_choice(scene.options, kOptions, "fault") == "deaf"),
        engine_(make_backend(option_choice(scene.options, kOptions, "engine"), scene_of(scene))) {}
  [[nodiscard]] std::string_view name() const override { return DUET_ALTERED_NAME; }
  [[nodiscard]] std::string version() const override { return "1"; }

 private:
  void do_reset() override {
    engine_->reset(state_);
    velocities_.setZero();
  }
  void do_set_partner(const HumanJoints& joints, const HumanJoints& velocities) override {
    joints_ = joints;
    velocities_ = velocities;
    engine_->set_partner(joints, deaf_ ? HumanJoints(HumanJoints::Zero()) : velocities);
  }
  Outcome do_step(const JointCommand& command) override {
    const Outcome outcome = engine_->step(command);
    state_ = engine_->state();
    torques_ = engine_->torques();
    contacts_.assign(engine_->contacts().begin(), engine_->contacts().end());
    if (deaf_ && !velocities_.isZero(0.0)) {  // it is where it should be, and its skin stands still
      joints_ += scene().dt * velocities_;
      engine_->set_partner(joints_, HumanJoints::Zero());
    }
    return outcome;
  }
  void do_push(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_W) override {
    engine_->push(link, f_W, p_W);
  }
  void do_kick(const Eigen::Vector3d& dv_W) override { engine_->kick(dv_W); }
  void do_snapshot(Snapshot& snapshot) const override {
    const Snapshot inner = engine_->snapshot();
    snapshot.values.insert(snapshot.values.end(), inner.values.begin(), inner.values.end());
  }
  void do_restore(std::span<const double> values) override { engine_->restore({{values.begin(), values.end()}}); }

  bool deaf_;
  HumanJoints joints_ = HumanJoints::Zero(), velocities_ = HumanJoints::Zero();
  std::unique_ptr<Backend> engine_;
};

std::string version() { return "1"; }
std::unique_ptr<Backend> make(const Scene& scene) { return std::make_unique<AlteredBackend>(scene); }
double bare_step_seconds(const Scene&, const RobotState&, const JointCommand&, int) { return 0.0; }

const EngineModule kModule = {.name = DUET_ALTERED_NAME,
                              .version = version,
                              .make = make,
                              .options = kOptions,
                              .bare_step_seconds = bare_step_seconds,
                              .no_solid_partner = DUET_ALTERED_LACKS};

}  // namespace
}  // namespace duet

DUET_ENGINE_MODULE(duet::kModule)
