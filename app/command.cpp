#include "duet/app/command.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/rows/json_fields.h"

namespace duet::cli {
namespace {

// The command that was being read, `duet hw check` rather than `duet`.
const CLI::App* last_command(const CLI::App& app) {
  const std::vector<CLI::App*> parsed = app.get_subcommands();
  return parsed.empty() ? &app : last_command(*parsed.back());
}

// "hw check "; "" of the program itself.
std::string command_words(const CLI::App& command) {
  return command.get_parent() == nullptr ? "" : command_words(*command.get_parent()) + command.get_name() + ' ';
}

// "--engines" for "--engine=ode"; "" where none of the command is near.
std::string nearest_option(const CLI::App& command, const std::string& word) {
  const std::string typed =
      word.substr(0, word.find('=')).substr(std::min<std::size_t>(2, word.find_first_not_of('-')));
  std::vector<std::string> names, begun;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back(name);
  std::ranges::copy_if(names, std::back_inserter(begun),
                       [&](const std::string& name) { return name.starts_with(typed); });
  const std::string near = typed.empty() ? "" : closest_name(typed, names);
  if (!near.empty()) return "--" + near;
  return typed.size() > 1 && begun.size() == 1 ? "--" + begun.front() : "";
}

std::string extras_message(const CLI::App& command, const std::vector<std::string>& extras) {
  std::string message = fmt::format("unexpected: {}", fmt::join(extras, " "));
  for (const std::string& word : extras) {
    const std::string near = word.starts_with("-") && word.size() > 2 ? nearest_option(command, word) : "";
    if (!near.empty()) message += fmt::format("; did you mean '{}'?", near);
  }
  return message;
}

// Names the commands that are expected, or the arguments that the command cannot do without.
std::string missing_message(const CLI::App& command, const std::string& fallback) {
  if (const std::vector<std::string> commands = command_names(command);
      !commands.empty() && command.get_require_subcommand_min() > 0)
    return fmt::format("expected a command, one of {}", fmt::join(commands, ", "));
  std::string message;
  for (const CLI::Option* option : command.get_options()) {
    if (!option->get_required() || option->count() > 0) continue;
    const std::string name = option->get_positional() ? option->get_single_name() : option->get_name();
    message += fmt::format("{}expected {}: {}", message.empty() ? "" : "; ", name, option->get_description());
  }
  return message.empty() ? fallback : message;
}

}  // namespace

std::string usage_message(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App& command = *last_command(app);
  const std::string words = command_words(command), help = fmt::format(" (duet {}--help shows what there is)", words);
  const std::string name = words.empty() ? "" : words.substr(0, words.size() - 1) + ": ";
  const std::vector<std::string> extras = app.remaining(true);
  if (!extras.empty()) return fmt::format("{}{}{}", name, extras_message(command, extras), help);
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr)
    return fmt::format("{}{}{}", name, missing_message(command, error.what()), help);
  return fmt::format("{}{}{}", name, error.what(), help);
}

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
    fmt::print("{}\n", dumped(json, 2));
  } else {
    fmt::print("{}", printable(text));
    if (!text.empty() && text.back() != '\n') fmt::print("\n");
  }
  if (std::fflush(stdout) != 0) throw InputError("cannot write to standard output");
}

void note(const Session& session, const std::string& text) {
  if (!session.quiet) print_error(printable(with_short_names(text)) + "\n");
}

void suggest_next(const Session& session, const std::string& command) {
  if (!session.json && isatty(STDERR_FILENO) != 0) note(session, "next: " + command);
}

void warn(const std::string& text) {
  print_error(fmt::format("duet: warning: {}\n", printable(with_short_names(text))));
}

void add_threads(CLI::App* command, int& threads, const std::string& what) {
  command->add_option("-j,--threads", threads, what)->capture_default_str()->check(CLI::Range(1, 1024));
}

void add_allow_programs(CLI::App& command, bool& allowed) {
  command.add_flag("--allow-programs", allowed,
                   "start the programs, and connect to the servers, that policy descriptors name, and the trainings of "
                   "a plan (docs/trust.md)");
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  return names;
}

std::pair<std::string, std::string> split_assignment(const std::string& text) {
  const size_t equals = text.find('=');
  require(equals != std::string::npos && equals > 0, "expected name=value, found '{}'", text);
  return {text.substr(0, equals), text.substr(equals + 1)};
}

}  // namespace duet::cli
