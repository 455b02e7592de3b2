// duet man: the manual page, made from the commands and options that there are.
#include <fmt/format.h>

#include <algorithm>

#include "duet/app/command.h"
#include "duet/app/version.h"

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

}  // namespace duet::cli
