// duet man: the manual page, made from the commands and options that there are.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "duet/app/command.h"
#include "duet/app/version.h"
#include "duet/core/named_table.h"
#include "duet/experiment/plan/shipped_suites.h"

namespace duet::cli {
namespace {

// A line of text: a backslash, and what at a line's begin would be a request, are escaped; hyphens are those of
// options.
std::string roff(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if ((c == '.' || c == '\'') && (escaped.empty() || escaped.back() == '\n')) escaped += "\\&";
    if (c == '\\')
      escaped += "\\e";
    else if (c == '-')
      escaped += "\\-";
    else
      escaped += c;
  }
  return escaped;
}

std::string option_page(const CLI::Option& option) {
  const std::string type = option.get_type_size() == 0 ? "" : " " + option.get_type_name();
  return fmt::format(".TP\n.B {}\n{}\n", roff(option.get_name(false, true) + type), roff(option.get_description()));
}

std::string command_page(const CLI::App& command, const std::string& parent) {
  const std::string name = parent + " " + command.get_name();
  std::string page = fmt::format(".SS {}\n{}\n", roff(name), roff(command.get_description()));
  for (const CLI::Option* option : command.get_options()) page += option_page(*option);
  if (const std::string footer = command.get_footer(); !footer.empty())
    page += fmt::format(".PP\n.nf\n{}\n.fi\n", roff(footer));
  for (const CLI::App* below : command.get_subcommands([](const CLI::App*) { return true; }))
    page += command_page(*below, name);
  return page;
}

std::string manual_page(const CLI::App& app) {
  std::string page = fmt::format(
      ".TH DUET 1 \"\" \"{0}\"\n.SH NAME\nduet \\- benchmark of two\\-person interactions with a humanoid\n"
      ".SH SYNOPSIS\n.B duet\n.I COMMAND\n[\\fIOPTION\\fR]...\n.SH DESCRIPTION\n{1}\n.SH COMMANDS\n",
      roff(std::string(version_text().substr(0, version_text().find('\n')))), roff(app.get_description()));
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    page += command_page(*command, "duet");
  return page + fmt::format(".SH NOTES\n.nf\n{}\n.fi\n", roff(app.get_footer()));
}

}  // namespace

void add_man(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "man", "the manual page, made from these commands and options",
                                  "duet man > ~/.local/share/man/man1/duet.1\n  man -l <(duet man)");
  command->callback([&session, &app] {
    const std::string page = manual_page(app);
    print(session, page, {{"page", page}});
  });
}

// duet completion: commands, options and names for the Tab key, as a script for bash (zsh runs the same one).

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
  require_known("shell", shell, kShells);
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
