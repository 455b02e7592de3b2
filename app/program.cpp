#include "duet/app/program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>
#include <system_error>

#include "duet/app/command.h"
#include "duet/app/version.h"
#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet::cli {
namespace {

// A message quotes what stands in files: it may neither fill the terminal nor command it.
constexpr std::size_t kLongestMessage = 4000;

int fail(int code, const std::string& message) {
  print_error(fmt::format("duet: {}\n", excerpt(with_short_names(message), kLongestMessage)));
  return code;
}

// "duet retarget hour.npz -o out", for faults that know nothing of what was being done.
std::string command_text(const Session& session) {
  constexpr std::size_t kWords = 5;
  const std::size_t words = std::min(session.argv.size(), kWords);
  return fmt::format("duet {}{}", fmt::join(session.argv.begin() + 1, session.argv.begin() + words, " "),
                     session.argv.size() > words ? " ..." : "");
}

std::string memory_limit_text() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return "";
  return fmt::format(" ({} MB are allowed: ulimit -v)", limit.rlim_cur >> 20U);
}

int fail_for_memory(const Session& session) {
  return fail(kExitUsage, fmt::format("not enough memory for `{}`{}: fewer threads (-j) and smaller inputs need "
                                      "less",
                                      command_text(session), memory_limit_text()));
}

int fail_for_system(const Session& session, const std::system_error& error) {
  if (error.code() != std::errc::resource_unavailable_try_again) return fail(kExitUsage, error.what());
  return fail(kExitUsage, fmt::format("cannot start a thread for `{}`{}: {}; fewer threads (-j) need less memory",
                                      command_text(session), memory_limit_text(), error.code().message()));
}

// A standard stream that is closed would be the number of the next file that is opened, and a file that grows past the
// limit (ulimit -f) would end the program: it is an error of writing.
void prepare_process() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (fcntl(stream, F_GETFD) == -1 && errno == EBADF && open("/dev/null", O_RDWR) != stream) std::_Exit(1);
  std::signal(SIGXFSZ, SIG_IGN);
#ifdef __GLIBC__
  // Arrays of megabytes come and go with every clip: given back to the system each time, they cost a page fault for
  // every 4 KiB when they are made anew, a quarter of the time of `duet dataset retarget`.
  constexpr int kMappedBytes = 32 << 20, kKeptBytes = 256 << 20;
  mallopt(M_MMAP_THRESHOLD, kMappedBytes);
  mallopt(M_TRIM_THRESHOLD, kKeptBytes);
#endif
}

struct Command {
  const char* name;
  void (*add)(CLI::App&, Session&);  // null: a part's
  const char* part = "";
};

// In the order of help.
constexpr Command kCommands[] = {{"doctor", add_doctor},
                                 {"list", add_list},
                                 {"synth", add_synth},
                                 {"import", nullptr, "data"},
                                 {"convert", nullptr, "data"},
                                 {"retarget", add_retarget},
                                 {"dataset", nullptr, "data"},
                                 {"score", add_score},
                                 {"run", add_run},
                                 {"report", add_report},
                                 {"policy", add_policy_check},
                                 {"controller", add_controller_import},
                                 {"robot", add_robot},
                                 {"plan", nullptr, "cluster"},
                                 {"work", nullptr, "cluster"},
                                 {"submit", nullptr, "cluster"},
                                 {"status", nullptr, "cluster"},
                                 {"merge", nullptr, "cluster"},
                                 {"publish", add_publish},
                                 {"compare", add_compare},
                                 {"attribute", add_attribute},
                                 {"blame", add_blame},
                                 {"check", add_check},
                                 {"bless", add_bless},
                                 {"validate", add_validate},
                                 {"verify", add_verify},
                                 {"bench", add_bench},
                                 {"train", nullptr, "training"},
                                 {"hw", nullptr, "robot"},
                                 {"replay", add_replay},
                                 {"rate", add_rate},
                                 {"agree", add_agree},
                                 {"replay-log", nullptr, "robot"},
                                 {"walk", add_walk},
                                 {"completion", add_completion},
                                 {"man", add_man}};

void (*adder_of(const Command& command))(CLI::App&, Session&) {
  return command.add != nullptr ? command.add : in_parts(&Part::commands, command.name);
}

// Adds all commands that are there. Returns a line that says which are not, and how to get them; empty: none.
std::string add_commands(CLI::App& app, Session& session) {
  std::map<std::string, std::vector<std::string>> missing;
  for (const Command& command : kCommands) {
    if (const auto add = adder_of(command))
      add(app, session);
    else
      missing[command.part].emplace_back(command.name);
  }
  std::string text;
  for (const auto& [part, names] : missing)
    text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", part, fmt::join(names, " "));
  return text.empty() ? ""
                      : fmt::format("\nParts that this program was built without: {}; `./run build` builds all.", text);
}

// The parser itself only says that a command is required.
void check_command(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return;
  const std::vector<std::string> known = command_names(app);
  if (std::ranges::find(known, argv[1]) == known.end()) {
    for (const Command& command : kCommands)
      if (app.get_parent() == nullptr && std::string_view(command.name) == argv[1])
        throw MissingError(missing_part_message(fmt::format("`duet {}`", command.name), command.part));
    throw std::invalid_argument(unknown_name_message("command", argv[1], known));
  }
  if (argc > 2 && argv[2][0] != '-' && app.get_subcommand(argv[1])->get_require_subcommand_min() > 0)
    check_command(*app.get_subcommand(argv[1]), argc - 1, argv + 1);
}

int run_command(CLI::App& app, int argc, char** argv, Session& session) {
  if (argc < 2) {  // nothing was asked for: what could be
    print_error(app.help());
    return kExitUsage;
  }
  try {
    check_command(app, argc, argv);
    app.parse(argc, argv);
    return session.exit_code;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    return fail(kExitUsage, usage_message(app, error));
  } catch (const MissingError& error) {
    return fail(kExitMissing, error.what());
  } catch (const std::filesystem::filesystem_error& error) {
    return fail(kExitUsage, fmt::format("cannot use '{}': {}", error.path1().string(), error.code().message()));
  } catch (const std::bad_alloc&) {
    return fail_for_memory(session);
  } catch (const std::system_error& error) {
    return fail_for_system(session, error);
  } catch (const std::exception& error) {
    return fail(kExitUsage, error.what());
  }
}

}  // namespace

int run_program(int argc, char** argv, std::vector<Part> with) {
  prepare_process();
  parts() = std::move(with);
  Session session;
  session.argv.assign(argv, argv + argc);
  CLI::App app(
      "duet: does a humanoid's side of a two-person interaction still work when the physics engine, the controller, "
      "the\n"
      "policy or the perception changes? Retargets two-person motion, rolls it out, scores it, ranks it.",
      "duet");
  app.set_version_flag("--version", version_text);
  app.require_subcommand(1);
  const std::string missing = add_commands(app, session);
  app.footer(
      "`duet COMMAND --help` shows the options of a command and an example.\n"
      "Exit codes: 0 ok, 1 a gate or check failed, 2 usage or input, 3 finished with errored episodes,\n"
      "4 something is not there, 5 other results than before, 75 and 130 stopped and resumable." +
      missing);
  return run_command(app, argc, argv, session);
}

}  // namespace duet::cli
