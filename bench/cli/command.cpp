#include "duet/bench/cli/command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet::cli {

CLI::App* add_command(CLI::App& app, Session& session, const std::string& name, const std::string& description,
                      const std::string& example) {
  CLI::App* command = app.add_subcommand(name, description);
  command->footer("Example:\n  " + example);
  command->add_flag("--json", session.json, "machine-readable output on standard output");
  command->add_flag("-q,--quiet", session.quiet, "no progress on standard error");
  return command;
}

void print(const Session& session, const std::string& text, const nlohmann::json& json) {
  if (session.json) {
    fmt::print("{}\n", json.dump(2));
  } else {
    fmt::print("{}", printable(text));
    if (!text.empty() && text.back() != '\n') fmt::print("\n");
  }
  if (std::fflush(stdout) != 0) throw InputError("cannot write to standard output");
}

void note(const Session& session, const std::string& text) {
  if (!session.quiet) print_error(printable(text) + "\n");
}

void suggest_next(const Session& session, const std::string& command) {
  if (!session.json && isatty(STDERR_FILENO) != 0) note(session, "next: " + command);
}

void warn(const std::string& text) { print_error(fmt::format("duet: warning: {}\n", printable(text))); }

void add_threads(CLI::App* command, int& threads, const std::string& what) {
  command->add_option("-j,--threads", threads, what)->capture_default_str()->check(CLI::Range(1, 1024));
}

void add_allow_programs(CLI::App& command, bool& allowed) {
  command.add_flag("--allow-programs", allowed,
                   "start the programs, and connect to the servers, that policy descriptors name (docs/trust.md)");
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  return names;
}

std::pair<std::string, std::string> split_assignment(const std::string& text) {
  const size_t equals = text.find('=');
  require(equals != std::string::npos && equals > 0, fmt::format("expected name=value, found '{}'", text));
  return {text.substr(0, equals), text.substr(equals + 1)};
}

}  // namespace duet::cli
