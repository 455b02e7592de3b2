// duet status: how far a planned run is.
#include <fmt/format.h>

#include <chrono>
#include <thread>

#include "duet/cluster/run_status.h"
#include "duet/experiment/work/interrupt.h"
#include "duet/parts/cluster/part.h"

namespace duet::cli {
namespace {

struct StatusArguments {
  std::string run;
  bool watch = false, unfinished = false;
  double every = 5.0;  // [s]
};

// A number a line, for what counts: `for`, GNU parallel, Snakemake.
std::string unfinished_text(const RunStatus& status) {
  std::string text;
  for (const ShardStatus& shard : status.shards)
    if (shard.state != ShardState::kDone) text += fmt::format("{}\n", shard.number);
  return text;
}

// Waits in short steps, so that a signal ends it soon.
void wait_for_next(double seconds) {
  constexpr std::chrono::milliseconds kStep(100);
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < until && interrupt() == Interrupt::kNone)
    std::this_thread::sleep_for(kStep);
}

void run_status_command(Session& session, const StatusArguments& arguments) {
  catch_interrupts();
  for (;;) {
    const RunStatus status = run_status(arguments.run);
    print(session, arguments.unfinished ? unfinished_text(status) : status_text(status), status_json(status));
    if (!arguments.watch || status.is_complete() || interrupt() != Interrupt::kNone) break;
    wait_for_next(arguments.every);
    if (interrupt() != Interrupt::kNone) break;
  }
  if (interrupt() != Interrupt::kNone)
    session.exit_code = interrupt() == Interrupt::kInterrupted ? kExitInterrupted : kExitResumable;
}

}  // namespace

void add_status(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "status",
                                  "how far a planned run is: done, running, failed, time left, by node and by shard",
                                  "duet status runs/core --watch");
  auto arguments = std::make_shared<StatusArguments>();
  command->add_option("run", arguments->run, "run directory that `duet plan` made")->required();
  command->add_flag("--unfinished", arguments->unfinished,
                    "only the numbers of the shards that are not done, a line each");
  command->add_flag("--watch", arguments->watch, "again and again, until all is done");
  command->add_option("--every", arguments->every, "time between two looks [s]")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 3600.0));
  command->callback([&session, arguments] { run_status_command(session, *arguments); });
}

}  // namespace duet::cli
