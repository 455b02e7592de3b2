// duet policy check: one observation for one policy, and what came back.
#include <fmt/format.h>

#include "duet/app/command.h"
#include "duet/app/policy_check.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/embodiments.h"
#include "duet/policies/catalogue/registry.h"

namespace duet::cli {
namespace {

struct CheckArguments {
  std::string policy, robot, task = "wave";
  std::vector<std::string> options;
  bool allow_programs = false;
};

nlohmann::json json_of(const PolicyCheck& check) {
  nlohmann::json inputs = nlohmann::json::array();
  for (const ShownInput& input : check.inputs) {
    nlohmann::json channels = nlohmann::json::array();
    for (const ShownChannel& channel : input.channels)
      channels.push_back(
          {{"name", channel.name}, {"size", channel.size}, {"low", channel.low}, {"high", channel.high}});
    inputs.push_back({{"name", input.name}, {"frames", input.frames}, {"channels", channels}});
  }
  return {{"policy", excerpt(check.info.name)},
          {"clip", check.clip},
          {"shown", inputs},
          {"asked_for", check.output},
          {"references", check.plan.size()},
          {"root_distance_m", check.root_distance},
          {"joints_at_limits", check.joints_at_limits},
          {"make_ms", check.make_ms},
          {"reset_ms", check.reset_ms},
          {"plan_ms", check.plan_ms},
          {"fault", check.faults.message}};
}

void run_check(Session& session, const CheckArguments& arguments) {
  PolicyOptions options;
  for (const std::string& text : arguments.options) options.insert(split_assignment(text));
  require_allowed(programs_of(SuitePolicy{policy_info(arguments.policy).name, arguments.policy}),
                  arguments.allow_programs);
  const PolicyCheck check =
      check_policy(arguments.policy, load_shared_robot(arguments.robot), options, parse_task(arguments.task));
  print(session, describe(check), json_of(check));
  if (check.faults.any() || check.plan.empty())
    throw InputError(check.faults.message.empty()
                         ? fmt::format("policy '{}': expected a plan, found none", excerpt(check.info.name))
                         : excerpt(check.faults.message, 400));
}

}  // namespace

void add_policy_check(CLI::App& app, Session& session) {
  CLI::App* policy = app.add_subcommand("policy", "one policy, by name or by its descriptor");
  policy->require_subcommand(1);
  CLI::App* command = add_command(*policy, session, "check",
                                  "show a policy one observation and print what came back (2: it does not answer as it "
                                  "should, 4: its program or network is not there)",
                                  "duet policy check examples/policies/wave_policy.yaml --allow-programs");
  auto arguments = std::make_shared<CheckArguments>();
  command->add_option("policy", arguments->policy, "policy descriptor (YAML), or the name of one of duet's own")
      ->required();
  command->add_option("--robot", arguments->robot, "robot card by name or path (default: the G1)");
  command->add_option("--task", arguments->task, "task of the clip")->capture_default_str();
  command->add_option("--option", arguments->options, "name=value, an option of the policy (repeatable)");
  add_allow_programs(*command, arguments->allow_programs);
  command->callback([&session, arguments] { run_check(session, *arguments); });
}

}  // namespace duet::cli
