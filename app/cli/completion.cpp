// duet completion: commands, options and names for the Tab key, as a script for bash (zsh runs the same one).
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "duet/app/command.h"
#include "duet/core/names.h"
#include "duet/experiment/plan/shipped_suites.h"

namespace duet::cli {
namespace {

const std::vector<std::string> kShells = {"bash", "zsh"};

constexpr const char* kScript = R"(_duet() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} words
  if [ "$COMP_CWORD" -eq 1 ]; then
    words="{commands} --help --version"
  else
    case "${{COMP_WORDS[1]}}" in
{cases}    esac
  fi
  COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _duet duet
)";

// "--json", ... and the commands below it.
std::vector<std::string> words_of(const CLI::App& command) {
  std::vector<std::string> words = command_names(command);
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) words.push_back("--" + name);
  return words;
}

std::vector<std::string> names_after(const std::string& command) {
  if (command == "run") return shipped_suite_names();
  if (command == "completion") return kShells;
  if (command == "list") return listing_names();
  return {};
}

std::string case_of(const CLI::App& app, const std::string& name) {
  std::vector<std::string> words = names_after(name);
  for (std::string& word : words_of(*app.get_subcommand(name))) words.push_back(std::move(word));
  return fmt::format("      {}) words=\"{}\" ;;\n", name, fmt::join(words, " "));
}

std::string script(const CLI::App& app, const std::string& shell) {
  std::string cases;
  const std::vector<std::string> commands = command_names(app);
  for (const std::string& name : commands) cases += case_of(app, name);
  const std::string text =
      fmt::format(fmt::runtime(kScript), fmt::arg("commands", fmt::format("{}", fmt::join(commands, " "))),
                  fmt::arg("cases", cases));
  return shell == "zsh" ? "autoload -U +X bashcompinit && bashcompinit\n" + text : text;
}

void run_completion(const Session& session, const CLI::App& app, const std::string& shell) {
  if (std::ranges::find(kShells, shell) == kShells.end())
    throw std::invalid_argument(unknown_name_message("shell", shell, kShells));
  const std::string text = script(app, shell);
  print(session, text, {{"shell", shell}, {"script", text}});
}

}  // namespace

void add_completion(CLI::App& app, Session& session) {
  CLI::App* command = add_command(
      app, session, "completion", "a script that completes commands, options and names",
      "duet completion bash > ~/.local/share/bash-completion/completions/duet\n  source <(duet completion bash)");
  auto shell = std::make_shared<std::string>();
  command->add_option("shell", *shell, "bash or zsh")->required();
  command->callback([&session, &app, shell] { run_completion(session, app, *shell); });
}

}  // namespace duet::cli
