#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/rows/folder/run_files.h"
#include "tests/support.h"

namespace duet {
namespace {

TEST(RunLitter, OnlyWhatADeadProcessLeftHalfWrittenGoes) {
  const test::ScratchFolder folder;
  std::filesystem::create_directories(folder / "trajectories");
  const std::string dead = "run.json.part-999999999-0", mine = "run.json.part-" + std::to_string(getpid()) + "-0";
  for (const std::string& name : {dead, mine, std::string("run.json.part-"), std::string("run.json.part-me"),
                                  std::string("run.json"), "trajectories/" + dead})
    write_file(folder / name, "x");
  remove_litter(folder / "");
  EXPECT_FALSE(std::filesystem::exists(folder / dead));
  EXPECT_FALSE(std::filesystem::exists(folder / ("trajectories/" + dead)));
  for (const std::string& name :
       {mine, std::string("run.json.part-"), std::string("run.json.part-me"), std::string("run.json")})
    EXPECT_TRUE(std::filesystem::exists(folder / name)) << name;
}

}  // namespace
}  // namespace duet
