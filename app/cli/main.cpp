// The `duet` program: parses the command line, runs one command, turns exceptions into one sentence and an exit code.
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

#include "duet/app/cli/robot/hw.h"
#include "duet/app/command.h"
#include "duet/app/version.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/short_names.h"
#include "duet/core/text.h"

namespace {

namespace cli = duet::cli;

// A message quotes what stands in files: it may neither fill the terminal nor command it.
constexpr std::size_t kLongestMessage = 4000;

int fail(int code, const std::string& message) {
  duet::print_error(fmt::format("duet: {}\n", duet::shown(duet::with_short_names(message), kLongestMessage)));
  return code;
}

// "duet retarget hour.npz -o out", for faults that know nothing of what was being done.
std::string command_text(const cli::Session& session) {
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

int fail_for_memory(const cli::Session& session) {
  return fail(cli::kExitUsage, fmt::format("not enough memory for `{}`{}: fewer threads (-j) and smaller inputs need "
                                           "less",
                                           command_text(session), memory_limit_text()));
}

int fail_for_system(const cli::Session& session, const std::system_error& error) {
  if (error.code() != std::errc::resource_unavailable_try_again) return fail(cli::kExitUsage, error.what());
  return fail(cli::kExitUsage, fmt::format("cannot start a thread for `{}`{}: {}; fewer threads (-j) need less memory",
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

// The parser itself only says that a command is required.
void check_command(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return;
  const std::vector<std::string> known = cli::command_names(app);
  if (std::ranges::find(known, argv[1]) == known.end())
    throw std::invalid_argument(duet::unknown_name_message("command", argv[1], known));
  if (argc > 2 && argv[2][0] != '-' && app.get_subcommand(argv[1])->get_require_subcommand_min() > 0)
    check_command(*app.get_subcommand(argv[1]), argc - 1, argv + 1);
}

int run_command(CLI::App& app, int argc, char** argv, cli::Session& session) {
  if (argc < 2) {  // nothing was asked for: what could be
    duet::print_error(app.help());
    return cli::kExitUsage;
  }
  try {
    check_command(app, argc, argv);
    app.parse(argc, argv);
    return session.exit_code;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    return fail(cli::kExitUsage, cli::usage_message(app, error));
  } catch (const duet::MissingError& error) {
    return fail(cli::kExitMissing, error.what());
  } catch (const std::filesystem::filesystem_error& error) {
    return fail(cli::kExitUsage, fmt::format("cannot use '{}': {}", error.path1().string(), error.code().message()));
  } catch (const std::bad_alloc&) {
    return fail_for_memory(session);
  } catch (const std::system_error& error) {
    return fail_for_system(session, error);
  } catch (const std::exception& error) {
    return fail(cli::kExitUsage, error.what());
  }
}

}  // namespace

int main(int argc, char** argv) {
  prepare_process();
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
  add_convert(app, session);
  add_retarget(app, session);
  add_dataset(app, session);
  add_score(app, session);
  add_run(app, session);
  add_report(app, session);
  add_policy_check(app, session);
  add_plan(app, session);
  add_work(app, session);
  add_submit(app, session);
  add_status(app, session);
  add_merge(app, session);
  add_publish(app, session);
  add_compare(app, session);
  add_check(app, session);
  add_bless(app, session);
  add_validate(app, session);
  add_verify(app, session);
  add_bench(app, session);
  add_train(app, session);
  add_hardware(app, session);
  add_replay(app, session);
  add_rate(app, session);
  add_agree(app, session);
  add_replay_log(app, session);
  add_walk(app, session);
  add_completion(app, session);
  add_man(app, session);
  return run_command(app, argc, argv, session);
}
