// duet robot: a card from a URDF (new), and what a run will need of a card (check).
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "duet/app/command.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/robots/authoring/card_draft.h"
#include "duet/robots/authoring/robot_check.h"

namespace duet::cli {
namespace {

// Descriptors that stand beside the card and are for it.
std::vector<std::string> descriptors_beside(const std::string& card) {
  namespace fs = std::filesystem;
  std::vector<std::string> found;
  std::error_code ignored;
  for (const auto& file : fs::directory_iterator(fs::absolute(card).parent_path(), ignored)) {
    if (file.path().extension() != ".yaml" || file.path().filename() == fs::path(card).filename()) continue;
    try {
      const std::string robot = load_descriptor(file.path().string()).robot;
      if (fs::path(robot).filename() == fs::path(card).filename()) found.push_back(file.path().string());
    } catch (const InputError&) {
      continue;  // no descriptor
    }
  }
  std::ranges::sort(found);
  return found;
}

// The controllers that ship for a robot or stand beside its card, and which of them lack their network here.
RobotFinding controllers_for(const RobotCheck& check) {
  std::vector<std::string> whole, without, names = descriptors_beside(check.card);
  for (const ControllerInfo& info : controllers())
    if (info.robot == check.name) names.push_back(info.name);
  for (const std::string& name : names) {
    const std::string shown = name.ends_with(".yaml") ? std::filesystem::path(name).filename().string() : name;
    try {
      static_cast<void>(controller_files(name));
      whole.push_back(shown);
    } catch (const MissingError&) {
      without.push_back(shown);
    }
  }
  std::string text = "pd and vmc (any body)";
  if (!whole.empty()) text += fmt::format(", {}", fmt::join(whole, ", "));
  if (!without.empty()) text += fmt::format("; without their network on this machine: {}", fmt::join(without, ", "));
  return {"controllers", names.empty() ? CheckState::kNote : CheckState::kOk, text,
          names.empty() ? "no network is for this robot: write an IO descriptor (duet controller import)" : ""};
}

std::string text_of(const RobotCheck& check) {
  std::string text = fmt::format("robot {}, card {}, description {}\n", check.name, check.card, check.urdf);
  for (const RobotFinding& finding : check.findings) {
    text += fmt::format("  {:<8} {:<12} {}\n", to_string(finding.state), finding.part, finding.found);
    if (!finding.next.empty())
      text += fmt::format("{:24}{}{}\n", "", finding.stops ? "first: " : "next: ", finding.next);
  }
  return text + (check.can_run() ? "A run can begin.\n" : "No run can begin.\n");
}

nlohmann::json json_of(const RobotCheck& check) {
  nlohmann::json findings = nlohmann::json::array();
  for (const RobotFinding& finding : check.findings)
    findings.push_back({{"part", finding.part},
                        {"state", to_string(finding.state)},
                        {"found", finding.found},
                        {"next", finding.next},
                        {"stops", finding.stops}});
  return {{"robot", check.name},
          {"card", check.card},
          {"urdf", check.urdf},
          {"findings", findings},
          {"can_run", check.can_run()}};
}

void run_check(Session& session, const std::string& card) {
  RobotCheck check = check_robot(card);
  check.findings.push_back(controllers_for(check));
  print(session, text_of(check), json_of(check));
  if (!check.can_run()) session.exit_code = kExitGate;
}

struct NewArguments {
  std::string urdf, output, name;
  bool force = false;
};

void run_new(Session& session, const NewArguments& arguments) {
  namespace fs = std::filesystem;
  std::string in_card = arguments.urdf;
  if (!arguments.output.empty()) {
    if (!arguments.output.ends_with(".yaml"))
      throw InputError(fmt::format("--output: expected a card's file name (.yaml), found '{}'", arguments.output));
    if (fs::exists(arguments.output) && !arguments.force)
      throw InputError(
          fmt::format("{}: expected a new file, found one that is there: --force writes over it", arguments.output));
    const std::string near =
        fs::proximate(fs::absolute(arguments.urdf), fs::absolute(arguments.output).parent_path()).string();
    in_card = near.starts_with("../../..") ? fs::absolute(arguments.urdf).string() : near;
  }
  const std::string name =
      arguments.name.empty() && !arguments.output.empty() ? fs::path(arguments.output).stem().string() : arguments.name;
  const CardDraft made = draft_card(read_text(arguments.urdf), arguments.urdf, name, in_card);
  if (!arguments.output.empty()) write_file(arguments.output, made.text);
  for (const std::string& sentence : made.proposed) note(session, "proposed: " + sentence);
  for (const std::string& sentence : made.missing) note(session, "to look up: " + sentence);
  const std::string said =
      fmt::format("{}: a card of '{}'; {} things to look up\n", arguments.output, made.name, made.missing.size());
  print(session, arguments.output.empty() ? made.text : said,
        {{"name", made.name}, {"card", made.text}, {"proposed", made.proposed}, {"missing", made.missing}});
  if (!arguments.output.empty()) suggest_next(session, fmt::format("duet robot check {}", arguments.output));
}

void add_new(CLI::App& robot, Session& session) {
  CLI::App* command = add_command(robot, session, "new",
                                  "write the scaffold of a robot card from a URDF: joints, roles by geometry, soles, "
                                  "tracks; what it assumes is marked, what is to be looked up stands on standard error",
                                  "duet robot new robot.urdf -o my.yaml");
  auto arguments = std::make_shared<NewArguments>();
  command->add_option("urdf", arguments->urdf, "URDF of the robot (run xacro first)")->required();
  command->add_option("--name", arguments->name, "name of the robot (default: the file's)");
  command->add_option("-o,--output", arguments->output, "file of the card (default: standard output)");
  command->add_flag("--force", arguments->force, "write over a card that is there");
  command->callback([&session, arguments] { run_new(session, *arguments); });
}

}  // namespace

void add_robot(CLI::App& app, Session& session) {
  CLI::App* robot = app.add_subcommand("robot", "one robot: a card from its URDF, and what a run needs of a card");
  robot->require_subcommand(1);
  add_new(*robot, session);
  CLI::App* command = add_command(*robot, session, "check",
                                  "say with figures what a run will need of a robot card, and what is missing or "
                                  "contradicts itself (1: no run can begin)",
                                  "duet robot check my.yaml");
  auto card = std::make_shared<std::string>();
  command->add_option("card", *card, "robot card by path, or the name of one that ships")->required();
  command->callback([&session, card] { run_check(session, *card); });
}

}  // namespace duet::cli
