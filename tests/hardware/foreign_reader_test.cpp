// The log of a run as programs read it that nobody here wrote: Foxglove's packages for MCAP, CDR and message
// definitions, in Node.js. `npm ci` in viewer/ installs them; without them the test is not run.
#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "duet/core/file.h"
#include "tests/hardware/logged_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr const char* kViewer = DUET_SOURCE_DIR "/viewer";

bool packages_are_there() {
  for (const char* package : {"@mcap/core", "@foxglove/rosmsg", "@foxglove/rosmsg2-serialization", "fzstd"})
    if (!std::filesystem::exists(std::filesystem::path(kViewer) / "node_modules" / package)) return false;
  return std::system("command -v node >/dev/null 2>&1") == 0;
}

// Time [ns], 0 for a state and 1 for a command, 29 positions.
using Row = std::array<double, 2 + kG1Motors>;

template <typename Frame>
Row row_of(double now, double kind, const Frame& frame) {
  Row row{std::round(1e9 * now), kind};
  for (int j = 0; j < kG1Motors; ++j) row[2 + j] = static_cast<double>(frame.motor[j].q);
  return row;
}

// A run of 6 s with arms that move; what was read and sent.
std::vector<Row> run_and_log(const std::string& path) {
  std::vector<Row> rows;
  test::LoggedTwin run(path, test::twin_guard(), {.place_noise = 0.001, .joint_noise = 1e-3});
  const auto remember = [&] {
    const GuardStatus& status = run.robot.guard.status();
    rows.push_back(row_of(status.input.now, 0.0, status.state_frame));
    if (status.sent) rows.push_back(row_of(status.input.now, 1.0, status.frame));
  };
  run.arm(remember);
  run.robot.message.command.q.array() += 0.5;
  run.run_for(4.0, remember);
  EXPECT_EQ(run.log.dropped(), 0);
  return rows;
}

TEST(ForeignReader, FindsThePositionsThatWereWrittenAndSeeks) {
  if (!packages_are_there()) GTEST_SKIP() << "not run: npm packages absent (viewer/node_modules, by npm ci)";
  const test::ScratchFolder folder;
  const std::vector<Row> written = run_and_log(folder / "run.mcap");
  const std::string command = std::string("cd ") + kViewer + " && node read_log.mjs " + (folder / "run.mcap") + " " +
                              (folder / "q.bin") + " >" + (folder / "found.json") + " 2>" + (folder / "errors");
  ASSERT_EQ(std::system(command.c_str()), 0) << read_file(folder / "errors");

  const std::string bytes = read_file(folder / "q.bin");
  ASSERT_EQ(bytes.size(), written.size() * sizeof(Row));
  std::vector<Row> found(written.size());
  std::memcpy(found.data(), bytes.data(), bytes.size());
  EXPECT_EQ(found, written);  // to the bit
  const nlohmann::json json = nlohmann::json::parse(read_file(folder / "found.json"));
  EXPECT_EQ(json["topics"]["rt/lowstate"].get<std::size_t>() + json["topics"]["rt/lowcmd"].get<std::size_t>(),
            written.size());
  EXPECT_GE(json["chunks"].get<int>(), 3);
  EXPECT_NEAR(json["seconds"].get<double>(), 6.3, 0.1);  // no message stands before the run's time
  EXPECT_NEAR(json["late"].get<double>(), 0.1 * 6.3 * 500.0, 5.0);
  EXPECT_LT(json["sought"].get<double>(), 0.6 * json["size"].get<double>());
  EXPECT_LT(json["opened"].get<double>(), 0.1 * json["size"].get<double>());
  EXPECT_EQ(json["health"]["state"], "run");
  const std::string elbow = test::g1()->joints[test::g1()->roles.arms[0][3]].name;
  EXPECT_NEAR(json["limiter"]["joints"][elbow]["asked"].get<double>(),
              test::g1()->neutral[test::g1()->roles.arms[0][3]] + 0.5, 1e-3);
}

}  // namespace
}  // namespace duet
