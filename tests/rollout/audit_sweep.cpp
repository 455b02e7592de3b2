// How many slips of adapters an audit names, and whether it names anything of descriptors that are right. Prints two
// tables; about ten minutes on one core. audit_sweep [right|slips] [NAME...]: of these controllers alone. Exit code 1
// where fewer than 26 of the 29 slips are named, or something is named of a descriptor that is right.
#include <fmt/format.h>

#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/rollout/audit/controller_audit.h"
#include "tests/controllers/audit_defects.h"

namespace duet {
namespace {

constexpr const char* kRight[] = {
    "holosoma",           "holosoma_fastsac", "holosoma_t1", "falcon",        "falcon_dec_loco",
    "unitree_rl_lab",     "unitree_rl_mjlab", "homie",       "playground",    "rl_gym",
    "g1_deploy_velocity", "g1_deploy_amp",    "booster_gym", "playground_t1", "rl_gym_h1",
    "rl_gym_h1_2",        "humanoid_gym",     "twist2"};

AuditSubject subject_of(const std::string& name) {
  AuditSubject subject;
  subject.descriptor = load_descriptor(name);
  subject.robot = load_shared_robot(card_path(subject.descriptor.robot));
  const std::string path = find_network(subject.descriptor);
  const NetworkFile network = load_network_file(path);
  subject.make = controllers_of_network(subject.robot, network.make, path);
  subject.physics = trial_physics(subject.descriptor, network.metadata, *subject.robot);
  return subject;
}

bool is_asked_for(const std::string& name, const std::vector<std::string>& only) {
  return only.empty() || std::ranges::find(only, name) != only.end();
}

// The part that is named first, or "nothing".
std::string first_of(const ControllerAudit& audit) {
  if (audit.defects.empty()) return "nothing";
  return fmt::format("{}: {}", to_string(audit.defects[0].part), audit.defects[0].said);
}

void print(const std::string& line) {
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

// Whether nothing is named.
bool sweep_right(const std::vector<std::string>& only) {
  int named = 0, all = 0;
  print("| controller | named | readings | seconds |\n|---|---|---:|---:|");
  for (const char* name : kRight) {
    if (!is_asked_for(name, only)) continue;
    try {
      const double begin = thread_computed_seconds();
      const ControllerAudit audit = audit_controller(subject_of(name));
      print(fmt::format("| `{}` | {} | {} | {:.0f} |", name, first_of(audit), audit.readings,
                        thread_computed_seconds() - begin));
      named += audit.defects.empty() ? 0 : 1;
      ++all;
    } catch (const MissingError&) {
      print(fmt::format("not run: {} absent", name));
    }
  }
  print(fmt::format("\nnamed though right: {} of {}\n", named, all));
  return named == 0;
}

bool sweep_slips(const std::vector<std::string>& only) {
  int named = 0, all = 0;
  print("| slip | in | named | right | seconds |\n|---|---|---|---|---:|");
  for (const test::InjectedDefect& defect : test::injected_defects()) {
    if (!is_asked_for(defect.controller, only)) continue;
    try {
      AuditSubject subject = subject_of(defect.controller);
      defect.inject(subject.descriptor, *subject.robot);
      const double begin = thread_computed_seconds();
      const ControllerAudit audit = audit_controller(subject);
      const bool right = !audit.defects.empty() && audit.defects[0].part == defect.part;
      print(fmt::format("| {} | `{}` | {} | {} | {:.0f} |", defect.name, defect.controller, first_of(audit),
                        right ? "yes" : "no", thread_computed_seconds() - begin));
      named += right ? 1 : 0;
      ++all;
    } catch (const MissingError&) {
      print(fmt::format("not run: {} absent", defect.controller));
    }
  }
  print(fmt::format("\nnamed: {} of {}", named, all));
  return all < 29 || named >= 26;
}

}  // namespace
}  // namespace duet

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  const std::vector<std::string> only(argv + std::min(argc, 2), argv + argc);
  const bool right = what == "slips" || duet::sweep_right(only);
  const bool slips = what == "right" || duet::sweep_slips(only);
  return right && slips ? 0 : 1;
}
