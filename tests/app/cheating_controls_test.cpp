// The two controls that were thought out against the rule `interaction`, end to end in physics: they are blind to the
// command, so that they may win what they do on purpose and nothing else.
#include <gmock/gmock.h>

#include <map>

#include "duet/execution/runner.h"
#include "duet/experiment/suite/profile.h"
#include "duet/rows/folder/run_directory.h"
#include "duet/rows/groups/row_groups.h"
#include "tests/support.h"

namespace duet {
namespace {

// A clip a task in both roles, a development seed, the partner solid.
Suite cheating_suite() {
  return parse_suite(
      "schema: duet.suite/1\nname: cheats\nversion: 1.0.0\nseed: 51515\n"
      "clips: {synth: {per_task: 1, seed: 51515, like: people, tracked: true}, pad: {before: 4, after: 2}, roles: "
      "both}\n"
      "tasks: [hug, handshake, high_five, wave, bend, fly_kiss]\nengines: [mujoco]\ncontrollers: [wbc_sim]\n"
      "policies: [patient, mirror]\nnull_arm: false\nstart: approach\nstart_radius: 0.5\npartner: solid\n"
      "max_root_speed: 0.6\ndetector: {version: interaction, thresholds: paper}\n",
      "cheats.yaml");
}

// Successes by policy and task, of two episodes each.
using Wins = std::map<std::pair<std::string, std::string>, int>;

Wins wins_of(const std::vector<EpisodeRow>& rows) {
  Wins wins;
  for (const EpisodeRow& row : rows)
    if (headline_success(row)) ++wins[{row.policy, row.task}];
  return wins;
}

// Successes that they may have of two, as they were measured over five clips in both roles (of ten): `patient` 2
// handshakes and 1 high-five, for its hand is at the partner's raised hand; `mirror` 7 waves, 3 fly-kisses and 1 hug,
// for it does as the partner does. Everything else they never won.
const Wins kMost = {{{"patient", "handshake"}, 1},
                    {{"patient", "high_five"}, 1},
                    {{"mirror", "wave"}, 2},
                    {{"mirror", "fly_kiss"}, 1},
                    {{"mirror", "hug"}, 1}};

TEST(CheatingControls, WinNothingThatTheyDoNotDoInKind) {
  if (!can_run_in("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const test::ScratchFolder scratch;
  Progress quiet(Progress::Style::kQuiet);
  RunOptions options;
  options.threads = 2;
  ASSERT_EQ(run_suite(cheating_suite(), scratch / "run", options, quiet).end, RunEnd::kComplete);
  const std::vector<EpisodeRow> rows = load_run(scratch / "run").rows;
  ASSERT_EQ(rows.size(), 24U);
  for (const auto& [won, count] : wins_of(rows)) {
    const auto most = kMost.find(won);
    EXPECT_LE(count, most == kMost.end() ? 0 : most->second) << won.first << " " << won.second;
  }
}

}  // namespace
}  // namespace duet
