// duet hw checklist: the form before a robot is armed.
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <memory>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/hardware/safety/checklist.h"
#include "duet/parts/robot/hw.h"

namespace duet::cli {
namespace {

struct ChecklistArguments {
  std::string config;
  bool makes = false;
};

double seconds_since_1970() { return static_cast<double>(std::time(nullptr)); }

std::string refusal_of(const Checklist& form, const std::string& config_path, const RobotConfig& config) {
  return checklist_refusal(form, config.checklist, config.permission.robot, sha256_file(config_path),
                           load_shared_robot()->digest, seconds_since_1970());
}

void make_form(Session& session, const std::string& config_path, const RobotConfig& config) {
  const std::string& path = config.checklist.form;
  if (std::filesystem::exists(path))
    throw InputError(fmt::format("checklist '{}': expected a path where no file is, found one", path));
  write_file(path, empty_checklist(config.permission.robot, sha256_file(config_path), load_shared_robot()->digest,
                                   seconds_since_1970()));
  print(session, fmt::format("made '{}': fill it in; a configuration that changes needs a new one", path),
        {{"form", path}});
}

void run_checklist(Session& session, const ChecklistArguments& arguments) {
  const RobotConfig config = read_robot_config(arguments.config);
  if (config.checklist.form.empty())
    throw InputError(fmt::format("{}: expected the key 'checklist' with its 'form', found none", arguments.config));
  if (arguments.makes) return make_form(session, arguments.config, config);
  const Checklist form = read_checklist(config.checklist.form);
  std::string text = fmt::format("robot '{}', filled in by {} at {}", form.robot, form.who, form.when);
  for (std::size_t k = 0; k < kChecklistItems; ++k)
    text += fmt::format("\n  {}: {}{}", kChecklist[k].name, form.answers[k].done ? "yes" : "no",
                        form.answers[k].value.empty() ? "" : ", " + form.answers[k].value);
  nlohmann::json json = checklist_json(form);
  const std::string refusal = refusal_of(form, arguments.config, config);
  json["refusal"] = refusal;
  print(session, text, json);
  if (!refusal.empty()) throw InputError(refusal);
}

}  // namespace

std::string checked_form(Session& session, const std::string& config_path, const RobotConfig& config) {
  if (config.checklist.form.empty()) return "";
  std::string refusal;
  Checklist form;
  try {
    form = read_checklist(config.checklist.form);
    refusal = refusal_of(form, config_path, config);
  } catch (const InputError& error) {
    refusal = error.what();
  }
  if (!refusal.empty() && config.checklist.required) throw InputError("not armed: " + refusal);
  if (!refusal.empty()) note(session, "warning: " + refusal);
  return form.who.empty() ? "" : dumped(checklist_json(form));
}

std::string when_commands_end(const RobotConfig& config) {
  const auto item = std::ranges::find(kChecklist, "commands_end", &ChecklistItem::name) - kChecklist.begin();
  std::string value;
  try {
    if (!config.checklist.form.empty())
      value = read_checklist(config.checklist.form).answers[static_cast<std::size_t>(item)].value;
  } catch (const InputError&) {  // said by checked_form()
  }
  return value.empty() ? "what it does then is not known: nobody filled in 'commands_end' of a checklist"
                       : fmt::format("on the gantry it then did: {}", value);
}

void add_checklist(CLI::App& hardware, Session& session) {
  const auto arguments = std::make_shared<ChecklistArguments>();
  CLI::App* app = add_command(hardware, session, "checklist",
                              "the form of a robot's checklist: make an empty one, or say whether one does",
                              "duet hw checklist robot.yaml --new");
  app->add_option("config", arguments->config, "configuration of the robot or twin (YAML)")->required();
  app->add_flag("--new", arguments->makes, "make an empty form where the configuration's 'checklist' says");
  app->callback([&session, arguments] { run_checklist(session, *arguments); });
}

}  // namespace duet::cli
