// Runs a suite into a folder and prints its verdict and its board: `run_a_suite SUITE.yaml OUT`. The same command goes
// on where it was stopped.
#include <fmt/format.h>

#include <exception>

#include "duet/execution/report_content.h"
#include "duet/execution/runner.h"
#include "duet/report/ranking/ranking.h"

int main(int argc, char** argv) try {
  if (argc != 3) {
    fmt::print(stderr, "usage: run_a_suite SUITE.yaml OUT\n");
    return 2;
  }
  const duet::Suite suite = duet::load_suite(argv[1]);
  duet::Progress progress;
  duet::RunOptions options;
  options.threads = 2;
  duet::run_suite(suite, argv[2], options, progress);
  const duet::Run run = duet::load_run(argv[2]);
  fmt::print("{}\n", duet::ranking_screen(duet::tables_of(run.rows, run).board, {}));
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "run_a_suite: {}\n", error.what());
  return 2;
}
