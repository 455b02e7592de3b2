// Prints the four tables of docs/controllers.md, in about 3 minutes; exit code 1 where somebody falls who should not.
#include <fmt/format.h>

#include <cstdio>

#include "tests/backends/engine_names.h"
#include "tests/controllers/published_cases.h"

namespace duet {
namespace {

using test::walk;
using test::Walk;
using test::WalkSetup;

struct Row {
  std::string controller, what, asked;
  WalkSetup setup;
  std::function<std::string(const Walk&)> say;
};

std::string speed(const Walk& r) { return fmt::format("{:.3f} m/s", r.forward); }
std::string height(const Walk& r) { return fmt::format("{:.3f} m", r.height); }
std::string speed_and_height(const Walk& r) { return fmt::format("{}, pelvis {}", speed(r), height(r)); }
std::string drift_and_rms(const Walk& r) { return fmt::format("{:.3f} m; {:.3f} rad", r.drift, r.joint_rms); }
std::string rms(const Walk& r) { return fmt::format("{:.3f} rad", r.joint_rms); }

std::string speed_and_arms(const Walk& r) {
  const auto robot = test::body("g1_27dof");
  return fmt::format("{}; arms {:.3f}, {:.3f} rad", speed(r), r.last.q[robot->joint_index("left_shoulder_pitch_joint")],
                     r.last.q[robot->joint_index("right_shoulder_pitch_joint")]);
}

WalkSetup lasting(WalkSetup setup, double seconds) {
  setup.seconds = seconds;
  return setup;
}

WalkSetup on_free_waist() {
  WalkSetup setup = test::homie("0.3,0,0");
  setup.card = "g1";
  setup.start = test::arms_down(*test::body("g1"));
  return setup;
}

std::vector<Row> rows() {
  std::vector<Row> all = {
      {"homie", "0.3 m/s, 10 s", "0.28 .. 0.32 m/s", test::homie("0.3,0,0"), speed_and_height},
      {"homie", "0.3 m/s, 60 s", "upright", lasting(test::homie("0.3,0,0"), 60.0), speed_and_height},
      {"homie", "0.3 m/s, both arms raised", "upright, -1.5 +- 0.06 rad", test::homie_with_raised_arms(),
       speed_and_arms},
      {"homie", "0.3 m/s on `g1`", "upright", on_free_waist(), speed}};
  for (const char* wanted : {"0.3", "0.5", "0.74"})
    all.push_back({"homie", fmt::format("standing, 5 s, height {} m", wanted), fmt::format("{} +- 0.025 m", wanted),
                   lasting(test::homie(fmt::format("0,0,0,{}", wanted)), 5.0), height});
  all.push_back({"rl_gym", "0.3 m/s, 10 s", "0.27 .. 0.31 m/s", test::rl_gym(), speed});
  all.push_back({"playground", "0.8 m/s, 10 s", "upright", test::playground(), speed});
  all.push_back({"playground", "0.8 m/s, 10 s, ground 0.02 s", "0.78 .. 0.84 m/s",
                 test::on_soft_ground(test::playground()), speed});
  all.push_back(
      {"twist2", "idle, 10 s: drift; joint RMS", "<= 0.03 m; <= 0.06 rad", test::twist2_idle(), drift_and_rms});
  if (!test::shared_file(test::kRecordedWalk).empty())
    all.push_back({"twist2", "`walk_001`, 13.9 s: joint RMS", "<= 0.09 rad", test::twist2_recorded_walk(), rms});
  return all;
}

std::string verdict(const Walk& r, const std::string& said) {
  return r.upright ? fmt::format("upright; {}", said) : fmt::format("falls at {:.2f} s; {}", r.seconds, said);
}

void print(const std::string& row) {
  fmt::print("{}\n", row);
  std::fflush(stdout);
}

bool absent(const char* what) {
  print(fmt::format("not run: {} absent", what));
  return true;
}

bool networks_are_here() {
  for (const char* name : {"homie", "playground", "rl_gym", "twist2"})
    if (test::shared_file(fmt::format("models/{}", load_descriptor(name).network)).empty()) return false;
  return true;
}

// Whether nobody fell.
bool print_controllers_in_mujoco() {
  if (!test::is_here("mujoco") || !networks_are_here()) return absent("mujoco or models/");
  bool all_stand = true;
  print("| controller | case | asked | measured |\n|---|---|---|---|");
  for (const Row& row : rows()) {
    const Walk result = walk(row.setup);
    const std::string said = verdict(result, row.say(result));
    print(fmt::format("| `{}` | {} | {} | {} |", row.controller, row.what, row.asked, said));
    all_stand = all_stand && result.upright;
  }
  return all_stand;
}

constexpr const char* kWalkers[] = {
    "holosoma",       "holosoma_fastsac", "holosoma_t1", "falcon",     "falcon_dec_loco",
    "unitree_rl_lab", "unitree_rl_mjlab", "homie",       "playground", "rl_gym"};

bool can_walk_here(const std::string& name) {
  return !test::shared_file("models/" + load_descriptor(name).network).empty();
}

void print_walkers() {
  print("| controller | engine | stands: drift | at 0.3 m/s | at 0.5 m/s | at 1.0 m/s |\n|---|---|---|---|---|---|");
  for (const char* name : kWalkers)
    for (const std::string& engine : test::engine_names()) {
      if (!test::is_here(engine) || !can_walk_here(name)) continue;
      std::string line = fmt::format("| `{}` | {} |", name, engine);
      for (const char* command : {"0,0,0", "0.3,0,0", "0.5,0,0", "1.0,0,0"}) {
        WalkSetup setup = test::walker(name, command, 14.0);
        setup.engine = engine;
        const Walk result = walk(setup);
        const std::string said = command[0] == '0' && command[1] == ',' ? fmt::format("{:.2f} m", result.drift)
                                                                        : fmt::format("{:.3f}", result.forward);
        line += result.upright ? fmt::format(" {} |", said) : fmt::format(" falls at {:.1f} s |", result.seconds);
      }
      print(line);
    }
}

void print_motions_of_trackers() {
  print("| controller | engine | seconds | joints, RMS | root, RMS |\n|---|---|---|---|---|");
  if (!can_walk_here("beyond_mimic") || !can_walk_here("rl_sar_dance")) {
    absent("models/");
    return;
  }
  for (WalkSetup setup : {test::tracked("beyond_mimic", test::beyond_mimic_motion(307)),
                          test::tracked("rl_sar_dance", test::rl_sar_dance())})
    for (const std::string& engine : test::engine_names()) {
      if (!test::is_here(engine)) continue;
      setup.engine = engine;
      const Walk result = walk(setup);
      print(fmt::format("| `{}` | {} | {:.1f}{} | {:.3f} rad | {:.3f} m |", setup.controller, engine, result.seconds,
                        result.upright ? "" : " (falls)", result.joint_rms, result.root_rms));
    }
}

bool print_engines() {
  if (!networks_are_here()) return absent("models/");
  bool all_stand = true;
  print("| engine | `homie` 0.3 m/s | `rl_gym` 0.3 m/s | `playground` 0.8 m/s | `twist2` idle, drift |");
  print("|---|---|---|---|---|");
  for (const std::string& engine : test::engine_names()) {
    if (!test::is_here(engine)) continue;
    std::string line = fmt::format("| {} |", engine);
    for (WalkSetup setup : {test::homie("0.3,0,0"), test::rl_gym(), test::playground(), test::twist2_idle()}) {
      setup.engine = engine;
      const Walk result = walk(setup);
      const std::string said = setup.controller == "twist2" ? fmt::format("{:.3f} m", result.drift) : speed(result);
      line += fmt::format(" {} |", verdict(result, said));
      all_stand = all_stand && result.upright;
    }
    print(line);
  }
  return all_stand;
}

}  // namespace
}  // namespace duet

int main() {
  const bool stand_in_mujoco = duet::print_controllers_in_mujoco();
  duet::print_walkers();
  duet::print_motions_of_trackers();
  return duet::print_engines() && stand_in_mujoco ? 0 : 1;
}
