// The blessed figures of results/golden, made again by this build: `duet run results/golden/suite.yaml -o RUN` and
// `duet bless RUN -o results/golden/baseline.json` where they change on purpose.
#include <gmock/gmock.h>

#include "duet/core/file.h"
#include "duet/execution/runner.h"
#include "duet/experiment/suite/profile.h"
#include "duet/report/ranking/golden.h"
#include "tests/support.h"

namespace duet {
namespace {

TEST(GoldenRun, AgreesWithTheBlessedBaseline) {
#ifdef DUET_SANITIZED
  GTEST_SKIP() << "not run: blessed with GCC; contact amplifies the last bits of another compiler's sums";
#endif
  const std::string folder = std::string(DUET_SOURCE_DIR) + "/results/golden/";
  const Suite suite = load_suite(folder + "suite.yaml");
  for (const std::string& engine : suite.engines)
    if (!can_run_in(engine)) GTEST_SKIP() << "not run: " << engine << " absent";
  const test::ScratchFolder scratch;
  Progress quiet(Progress::Style::kQuiet);
  RunOptions options;
  options.threads = 2;
  EXPECT_EQ(run_suite(suite, scratch / "run", options, quiet).end, RunEnd::kComplete);
  const duet::Run run = load_run(scratch / "run");
  for (const GoldenDifference& difference : check(read_file(folder + "baseline.json"), leaderboard(run.rows), run.info))
    ADD_FAILURE() << difference.where << ": expected " << difference.expected << ", found " << difference.found;
}

}  // namespace
}  // namespace duet
