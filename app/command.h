// Options, output and exit codes that every command of the `duet` program shares (docs/command-line.md).
#pragma once

#include <CLI/CLI.hpp>
#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/experiment/work/run_work.h"

namespace duet::cli {

enum ExitCode : int {
  kExitOk = 0,
  kExitGate = 1,           // a gate, regression check or comparison failed
  kExitUsage = 2,          // usage, configuration or input
  kExitErrors = 3,         // finished, with episodes or clips that have no result: errors, time-outs, unsupported ones
  kExitMissing = 4,        // engine, asset or device that is not there
  kExitDeterminism = 5,    // verify: other hashes
  kExitResumable = 75,     // stopped early (time limit, SIGTERM, SIGHUP): the same command goes on
  kExitInterrupted = 130,  // Ctrl-C: the same command goes on
};

struct Session {
  bool json = false;   // machines read standard output
  bool quiet = false;  // no progress
  int exit_code = kExitOk;
  std::vector<std::string> argv;
  std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();

  [[nodiscard]] Progress::Style progress() const { return quiet ? Progress::Style::kQuiet : Progress::Style::kAuto; }
};

// A subcommand with its description, its example under --help, and --json / --quiet.
CLI::App* add_command(CLI::App& app, Session& session, const std::string& name, const std::string& description,
                      const std::string& example);

// `text` on standard output, or `json` with --json.
void print(const Session& session, const std::string& text, const nlohmann::json& json);
// A message for the person, on standard error, unless quiet.
void note(const Session& session, const std::string& text);

// "next: duet report runs/core", on standard error where a person reads it: a terminal, and neither --quiet nor --json.
void suggest_next(const Session& session, const std::string& command);

// The option --allow-programs (docs/trust.md).
void add_allow_programs(CLI::App& command, bool& allowed);

// A warning on standard error, also with --quiet.
void warn(const std::string& text);

// The option -j,--threads, 1 to 1024.
void add_threads(CLI::App* command, int& threads, const std::string& what = "threads");

// The commands of the program, or of a command that has commands, in the order of its help.
std::vector<std::string> command_names(const CLI::App& app);

// One sentence for what the parser refused: what the command was given that it does not know, in the order in which it
// was given and with the nearest option; or what it needs and was not given.
std::string usage_message(const CLI::App& app, const CLI::ParseError& error);

// "a=b" -> {a, b}; throws std::invalid_argument.
std::pair<std::string, std::string> split_assignment(const std::string& text);

// The names that `duet list` takes.
std::vector<std::string> listing_names();

void add_doctor(CLI::App& app, Session& session);
void add_list(CLI::App& app, Session& session);
void add_synth(CLI::App& app, Session& session);
void add_retarget(CLI::App& app, Session& session);
void add_score(CLI::App& app, Session& session);
void add_run(CLI::App& app, Session& session);
void add_report(CLI::App& app, Session& session);
void add_replay(CLI::App& app, Session& session);
void add_rate(CLI::App& app, Session& session);
void add_agree(CLI::App& app, Session& session);
void add_compare(CLI::App& app, Session& session);
void add_attribute(CLI::App& app, Session& session);
void add_blame(CLI::App& app, Session& session);
void add_check(CLI::App& app, Session& session);
void add_bless(CLI::App& app, Session& session);
void add_policy_check(CLI::App& app, Session& session);       // `policy check`
void add_controller_import(CLI::App& app, Session& session);  // `controller import`
void add_robot(CLI::App& app, Session& session);              // `robot new`, `robot check`
void add_publish(CLI::App& app, Session& session);
void add_validate(CLI::App& app, Session& session);
void add_verify(CLI::App& app, Session& session);
void add_bench(CLI::App& app, Session& session);
void add_completion(CLI::App& app, Session& session);
void add_man(CLI::App& app, Session& session);
void add_walk(CLI::App& app, Session& session);

}  // namespace duet::cli
