// An engine that fails: a module like any other, built for tests/app/fault_test.cpp. It plays the reference back, and
// at half a second it does what its option `fault` says.
#include <csignal>
#include <stdexcept>

#include "duet/backends/engine_module.h"
#include "duet/backends/physics_backend.h"

namespace duet {
namespace {

const EngineOption kOptions[] = {
    choice_option("fault", {"throw", "diverge", "crash", "vanish", "none"}, "what happens at 0.5 s")};

class FaultyBackend final : public PhysicsBackend {
 public:
  explicit FaultyBackend(const Scene& scene)
      : PhysicsBackend(scene), fault_(option_choice(scene.options, kOptions, "fault")) {}
  [[nodiscard]] std::string_view name() const override { return "faulty"; }
  [[nodiscard]] std::string version() const override { return "1"; }

 private:
  void place() override {}
  void do_kick(const Eigen::Vector3d&) override {}
  Outcome advance(const JointCommand&) override {
    if (time() < 0.5) return Outcome::kOk;
    if (fault_ == "crash") std::raise(SIGSEGV);
    if (fault_ == "vanish") std::raise(SIGKILL);
    if (fault_ == "throw") throw std::runtime_error("faulty: an error of the engine itself");
    return fault_ == "diverge" ? Outcome::kDiverged : Outcome::kOk;
  }
  void append_to(std::vector<double>&) const override {}
  void read_from(std::span<const double>) override {}

  std::string fault_;
};

std::string version() { return "1"; }
std::unique_ptr<Backend> make(const Scene& scene) { return std::make_unique<FaultyBackend>(scene); }
double bare_step_seconds(const Scene&, const RobotState&, const JointCommand&, int) { return 0.0; }

const EngineModule kModule = {
    .name = "faulty", .version = version, .make = make, .options = kOptions, .bare_step_seconds = bare_step_seconds};

}  // namespace
}  // namespace duet

DUET_ENGINE_MODULE(duet::kModule)
