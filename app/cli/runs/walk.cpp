// duet walk: the suite `walk` for those who want to see whether a controller walks.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "duet/app/cli/runs/run_command.h"
#include "duet/app/command.h"
#include "duet/core/parallel.h"

namespace duet::cli {
namespace {

struct WalkArguments {
  std::vector<double> velocity;
  double seconds = 0.0;
};

}  // namespace

void add_walk(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "walk", "does it walk, how fast, does it fall: the suite `walk`",
                                  "duet walk homie --network homie=homie_deploy.onnx\n"
                                  "  duet walk wbc_sim vmc --velocity 0.4,0,0 --engines mujoco,ode");
  auto arguments = std::make_shared<RunArguments>();
  auto walk = std::make_shared<WalkArguments>();
  arguments->suite.suite = "walk";
  arguments->output = "runs/walk";
  arguments->options.threads = default_threads();
  command->add_option("controllers", arguments->options.controllers, "only these (default: all of the suite)");
  command
      ->add_option("--velocity", walk->velocity, "forward, sideways [m/s], turn [rad/s] (default: the suite's three)")
      ->delimiter(',')
      ->expected(3);
  command->add_option("--seconds", walk->seconds, "how long; with --velocity")
      ->check(CLI::Range(1.0, 600.0))
      ->needs(command->get_option("--velocity"));
  command->add_option("--engines", arguments->options.engines, "only these")->delimiter(',');
  command->add_option("--network", arguments->suite.networks, "NAME=PATH: the network of a controller (repeatable)");
  command->add_option("-o,--output", arguments->output, "run directory")->capture_default_str();
  add_threads(command, arguments->options.threads);
  command->callback([&session, arguments, walk, command] {
    if (command->count("--output") == 0)
      note(session, fmt::format("writing to {} (--output names another folder)", arguments->output));
    if (!walk->velocity.empty())
      arguments->suite.overrides.push_back(
          fmt::format("reference={{velocity: [{}]{}}}", fmt::join(walk->velocity, ", "),
                      walk->seconds > 0.0 ? fmt::format(", seconds: {}", walk->seconds) : ""));
    run_suite_command(session, *arguments);
  });
}

}  // namespace duet::cli
