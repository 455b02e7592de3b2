// An engine in a process of its own, whose host does at its 200th step what the option `fault` says
// (tests/backends/fake_host.py), as a module for fault_test.cpp.
#include "duet/backends/engine_module.h"
#include "duet/backends/host/host_backend.h"

namespace duet {
namespace {

const EngineOption kOptions[] = {
    choice_option("fault", {"none", "exit", "nan", "short", "echo", "say"}, "what happens at the 200th step")};

std::string version() { return "1"; }
std::unique_ptr<Backend> make(const Scene& scene) {
  return make_host_backend(
      scene,
      {.engine = "hosted",
       .version = version(),
       .command = {"python3", DUET_FAKE_HOST, option_choice(scene.options, kOptions, "fault"), "200"}},
      kOptions);
}

const EngineModule kModule = {.name = "hosted", .version = version, .make = make, .options = kOptions};

}  // namespace
}  // namespace duet

DUET_ENGINE_MODULE(duet::kModule)
