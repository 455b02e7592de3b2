// The drawings that stand alone, of a small input, as it was looked at: tests/report/pictures. Where one is drawn
// otherwise on purpose, the test's message says which file to look at and to copy.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/report/engines/cross_engine.h"
#include "duet/report/page/key_frames.h"
#include "duet/report/page/run_analyses.h"
#include "tests/rows/rows.h"

namespace duet {
namespace {

using test::engine_episode;
using test::episode;

void expect_picture(const std::string& name, const std::string& svg) {
  const std::string recorded = fmt::format("{}/tests/report/pictures/{}.svg", DUET_SOURCE_DIR, name);
  const std::string found = testing::TempDir() + name + ".svg";
  write_file(found, svg + "\n");
  ASSERT_TRUE(std::filesystem::exists(recorded)) << "look at " << found << " and copy it to " << recorded;
  EXPECT_EQ(read_file(recorded), svg + "\n") << "look at " << found << " and copy it to " << recorded;
  std::filesystem::remove(found);
}

std::vector<EpisodeRow> rows_of_two_engines() {
  std::vector<EpisodeRow> rows;
  for (const char* engine : {"mujoco", "bullet"})
    for (const char* policy : {"replay", "dp"})
      for (int number = 0; number < 6; ++number)
        rows.push_back(engine_episode(engine, policy, number, number % (*policy == 'r' ? 3 : 2) > 0, "vmc"));
  for (int number = 0; number < 6; ++number) rows.push_back(episode("null", "hug", number, number == 0, "null"));
  return rows;
}

TEST(Pictures, PlotsOfSuccess) {
  expect_picture("engine_plot", engine_plot_svg(cross_engine(rows_of_two_engines(), {})));
}

// Without physics stands below the engines, as far from the last as they are from each other.
TEST(Pictures, PlaybackBelowTheEngines) {
  std::vector<EpisodeRow> rows = rows_of_two_engines();
  for (int number = 0; number < 6; ++number)
    rows.push_back(engine_episode("playback", "replay", number, number > 0, "none"));
  expect_picture("engine_plot_playback", engine_plot_svg(cross_engine(rows, {})));
}

// A person with one hand up and another who bows; the first has a head.
TEST(Pictures, KeyFrames) {
  const std::vector<std::pair<int, int>> bones = {{0, 1}, {1, 2}, {0, 3}, {0, 4}, {1, 5}, {1, 6}};
  const StickFigure upright{"human",
                            {{0.0, 0.0, 0.9},
                             {0.0, 0.0, 1.4},
                             {0.0, 0.0, 1.6},
                             {0.0, -0.1, 0.0},
                             {0.0, 0.1, 0.0},
                             {0.0, -0.3, 1.1},
                             {0.1, 0.4, 1.9}},
                            bones};
  const StickFigure bowing{"robot",
                           {{1.2, 0.1, 0.8},
                            {1.0, 0.1, 1.1},
                            {0.8, 0.1, 1.2},
                            {1.2, 0.0, 0.0},
                            {1.25, 0.2, 0.0},
                            {0.9, -0.1, 0.7},
                            {0.9, 0.3, 0.6}},
                           bones};
  StickFigure headless = upright;
  headless.label = "source";
  headless.bones = {{0, 1}, {0, 3}, {0, 4}};
  expect_picture("key_frames",
                 key_frames_svg({{"start 0.00 s", {upright, bowing}}, {"act 1.00 s", {headless, bowing}}}));
}

}  // namespace
}  // namespace duet
