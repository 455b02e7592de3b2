// The `duet` program: parses the command line, runs one command, turns exceptions into one sentence and an exit code.
#include <fmt/format.h>

#include <cstdio>
#include <exception>

#include "bench/cli/command.h"
#include "bench/version.h"
#include "core/require.h"

namespace {

namespace cli = duet::cli;

int fail(int code, const std::string& message) {
  fmt::print(stderr, "duet: {}\n", message);
  return code;
}

int run_command(CLI::App& app, int argc, char** argv, cli::Session& session) {
  try {
    app.parse(argc, argv);
    return session.exit_code;
  } catch (const CLI::ParseError& error) {
    const int code = app.exit(error);
    return code == 0 ? cli::kExitOk : cli::kExitUsage;
  } catch (const duet::MissingError& error) {
    return fail(cli::kExitMissing, error.what());
  } catch (const std::exception& error) {
    return fail(cli::kExitUsage, error.what());
  }
}

}  // namespace

int main(int argc, char** argv) {
  duet::cli::Session session;
  session.argv.assign(argv, argv + argc);
  CLI::App app(
      "duet: does a humanoid's side of a two-person interaction still work when the physics engine, the controller, "
      "the\n"
      "policy or the perception changes? Retargets two-person motion, rolls it out, scores it, ranks it.",
      "duet");
  app.set_version_flag("--version", duet::version_text);
  app.require_subcommand(1);
  app.footer(
      "`duet COMMAND --help` shows the options of a command and an example.\n"
      "Exit codes: 0 ok, 1 a gate or check failed, 2 usage or input, 3 finished with errored episodes,\n"
      "4 something is not there, 5 other results than before, 75 and 130 stopped and resumable.");
  using namespace duet::cli;
  add_doctor(app, session);
  add_list(app, session);
  add_synth(app, session);
  add_import(app, session);
  add_retarget(app, session);
  add_score(app, session);
  add_run(app, session);
  add_report(app, session);
  add_publish(app, session);
  add_compare(app, session);
  add_check(app, session);
  add_bless(app, session);
  add_validate(app, session);
  add_verify(app, session);
  add_bench(app, session);
  add_train(app, session);
  return run_command(app, argc, argv, session);
}
