// duet doctor: what this build and this machine can do.
#include <fmt/format.h>

#include <algorithm>

#include "duet/app/part.h"
#include "duet/app/version.h"
#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/controller.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/replay/replay_page.h"
#include "duet/retarget/solver/pair.h"
#include "duet/robots/robot_cards.h"
#include "duet/robots/robot_model.h"
#include "duet/rows/folder/environment.h"

namespace duet::cli {
namespace {

Finding robot_finding(const RobotCardFile& card) {
  const std::string part = "robot " + card.name;
  try {
    const RobotModel robot = load_robot(card.path);
    return {part, true, fmt::format("{} joints, {:.4f} kg, card {}", robot.dof(), robot.total_mass(), card.path)};
  } catch (const std::exception& error) {
    return {part, false, error.what()};
  }
}

void add_robots(std::vector<Finding>& list) {
  try {
    for (const RobotCardFile& card : robot_cards()) list.push_back(robot_finding(card));
  } catch (const std::exception& error) {
    list.push_back({"robots", false, error.what()});
  }
}

// Whether it can be made here: its card is there, its network is found and can be read.
Finding controller_finding(const ControllerInfo& info) {
  try {
    const auto robot = load_shared_robot(info.robot);
    static_cast<void>(make_controller(info.name, robot));
    const bool network = std::any_of(info.options.begin(), info.options.end(),
                                     [](const ControllerOption& option) { return option.name == "network"; });
    return {"controller " + info.name, true,
            fmt::format("body {}{}", info.robot.empty() ? "any" : info.robot, network ? ", network found" : "")};
  } catch (const std::exception& error) {
    return {"controller " + info.name, false, error.what()};
  }
}

// The bundle that `duet replay` and `duet report --replays` put into their pages.
Finding viewer_finding() {
  try {
    const ViewerBundle viewer = load_viewer();
    return {"viewer of replays", true, fmt::format("{} kB", (viewer.script.size() + viewer.style.size()) / 1000)};
  } catch (const std::exception& error) {
    return {"viewer of replays", false, error.what()};
  }
}

std::vector<Finding> findings() {
  std::vector<Finding> list;
  for (const EngineInfo& engine : engines())
    list.push_back({"engine " + engine.name, engine.available, engine.available ? engine.version : engine.reason});
  std::string kernels;
  for (const KernelKind kernel : available_kernels())
    kernels += fmt::format("{}{}", kernels.empty() ? "" : ", ", to_string(kernel));
  list.push_back({"PAIR kernels", true, kernels});
  add_robots(list);
  for (const ControllerInfo& info : controllers()) list.push_back(controller_finding(info));
  for (const Part& part : parts())
    if (part.findings != nullptr) std::ranges::move(part.findings(), std::back_inserter(list));
  list.push_back(viewer_finding());
  list.push_back({"machine", true, describe_machine()});
  return list;
}

// Throws std::invalid_argument for an unknown engine, with the nearest, and MissingError for one that is absent.
void check_needed(const std::vector<std::string>& needed) {
  for (const std::string& engine : needed) {
    for (const EngineInfo& info : engines()) {
      if (info.name == engine && !info.available)
        throw MissingError(fmt::format("engine '{}' is absent: {}", engine, info.reason));
    }
    Scene scene;
    scene.robot = load_shared_robot();
    make_backend(engine, scene);
  }
}

void run_doctor(Session& session, const std::vector<std::string>& needed) {
  check_needed(needed);
  const std::vector<Finding> list = findings();
  nlohmann::json json = {{"version", duet_version()}, {"parts", nlohmann::json::array()}};
  std::string text = version_text() + "\n";
  for (const Finding& finding : list) {
    json["parts"].push_back({{"part", finding.part}, {"present", finding.present}, {"detail", finding.detail}});
    text += fmt::format("  {:<6} {:<24} {}\n", finding.present ? "ok" : "absent", finding.part, finding.detail);
  }
  json["environment"] = capture_environment();
  print(session, text, json);
}

}  // namespace

void add_doctor(CLI::App& app, Session& session) {
  CLI::App* command =
      add_command(app, session, "doctor", "what this build and this machine can do", "duet doctor --need mujoco");
  auto needed = std::make_shared<std::vector<std::string>>();
  command->add_option("--need", *needed, "engines that must be there (exit code 4 if not)")->delimiter(',');
  command->callback([&session, needed] { run_doctor(session, *needed); });
}

}  // namespace duet::cli
