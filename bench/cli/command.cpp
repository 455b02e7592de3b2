#include "bench/cli/command.h"

#include <fmt/format.h>

#include <cstdio>

#include "core/require.h"

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
    fmt::print("{}", text);
    if (!text.empty() && text.back() != '\n') fmt::print("\n");
  }
  if (std::fflush(stdout) != 0) throw InputError("cannot write to standard output");
}

void note(const Session& session, const std::string& text) {
  if (!session.quiet) fmt::print(stderr, "{}\n", text);
}

std::pair<std::string, std::string> split_assignment(const std::string& text) {
  const size_t equals = text.find('=');
  require(equals != std::string::npos && equals > 0, fmt::format("expected name=value, found '{}'", text));
  return {text.substr(0, equals), text.substr(equals + 1)};
}

}  // namespace duet::cli
