#include "duet/cluster/shard_plan.h"

#include <algorithm>
#include <numeric>

#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

std::vector<PlanBlock> some_blocks(Random& random, int engines) {
  std::vector<PlanBlock> blocks;
  std::int64_t place = 0;
  for (int engine = 0; engine < engines; ++engine) {
    for (int i = 0; i <= random.below(20); ++i) {
      const std::int64_t end = place + 2;
      blocks.push_back({"engine" + std::to_string(engine), place, end, random.uniform(0.5, 20.0)});
      place = end;
    }
  }
  return blocks;
}

TEST(ShardPlan, EachBlockIsInOneShardOfItsEngine) {
  Random random(7, 22);
  for (int round = 0; round < 200; ++round) {
    const std::vector<PlanBlock> blocks = some_blocks(random, 1 + random.below(4));
    const auto least = static_cast<int>(std::ssize(cut_shards(blocks, 0)));
    const int most = static_cast<int>(blocks.size());
    const int count = least + random.below(most - least + 1);
    const std::vector<Shard> shards = cut_shards(blocks, count);
    ASSERT_EQ(std::ssize(shards), count);
    std::int64_t next = 0;
    for (const Shard& shard : shards) {
      EXPECT_EQ(shard.begin, next);
      EXPECT_LT(shard.begin, shard.end);
      next = shard.end;
      double cost = 0.0;
      for (const PlanBlock& block : blocks) {
        if (block.begin < shard.begin || block.end > shard.end) continue;
        EXPECT_EQ(block.engine, shard.name);
        cost += block.cost;
      }
      EXPECT_NEAR(cost, shard.cost, 1.0e-9 * cost);
    }
    EXPECT_EQ(next, blocks.back().end);
  }
}

// A shard of one engine differs from the mean by the costliest block at most.
TEST(ShardPlan, ShardsOfAnEngineCostTheSame) {
  Random random(8, 22);
  for (int round = 0; round < 100; ++round) {
    std::vector<PlanBlock> blocks;
    for (int i = 0; i < 200; ++i) blocks.push_back({"mujoco", i, i + 1, random.uniform(0.5, 2.0)});
    const double all = std::accumulate(blocks.begin(), blocks.end(), 0.0,
                                       [](double sum, const PlanBlock& block) { return sum + block.cost; });
    const int count = 1 + random.below(20);
    for (const Shard& shard : cut_shards(blocks, count)) EXPECT_NEAR(shard.cost, all / count, 2.0);
  }
}

TEST(ShardPlan, ByItselfShardsTakeAboutFourMinutes) {
  std::vector<PlanBlock> blocks;
  for (int i = 0; i < 1000; ++i) blocks.push_back({i < 700 ? "ode" : "mujoco", i, i + 1, i < 700 ? 10.0 : 1.5});
  const std::vector<Shard> shards = cut_shards(blocks, 0);
  EXPECT_EQ(std::ranges::count(shards, "ode", &Shard::name), 30);    // 7000 s
  EXPECT_EQ(std::ranges::count(shards, "mujoco", &Shard::name), 2);  // 450 s
  for (const Shard& shard : shards) {
    EXPECT_GE(shard.cost, 120.0);
    EXPECT_LE(shard.cost, 600.0);
  }
}

TEST(ShardPlan, RefusesNumbersThatCannotBe) {
  const std::vector<PlanBlock> blocks = {{"mujoco", 0, 2, 1.0}, {"mujoco", 2, 4, 1.0}, {"ode", 4, 6, 1.0}};
  const auto refusal = [&](std::int64_t count) {
    return test::thrown_message<std::invalid_argument>([&] { static_cast<void>(cut_shards(blocks, count)); });
  };
  EXPECT_SENTENCE(refusal(1));
  EXPECT_SENTENCE(refusal(4));
  EXPECT_EQ(cut_shards(blocks, 3).size(), 3U);
}

class PlanFile : public testing::Test {
 protected:
  PlanFile() {
    plan_.program = {{"duet", std::string(64, 'a')}, {"mujoco", std::string(64, 'b')}};
    plan_.suite_hash = "cafe";
    plan_.episodes = 4;
    plan_.clips = {{"wave", "wave-000", "clips/000000.npz", std::string(64, 'c')}};
    plan_.costs = {{"mujoco/vmc", 0.03125}};
    plan_.shards = cut_shards({{"mujoco", 0, 2, 1.25}, {"mujoco", 2, 4, 1.5}}, 2);
    for (Shard& shard : plan_.shards) shard.keys = "k" + std::to_string(shard.begin);
    write_shard_plan(plan_, run());
  }
  [[nodiscard]] std::string run() const { return folder_ / "run"; }
  // The refusal of the file with a piece of it replaced.
  std::string refusal_with(const std::string& from, const std::string& to) {
    write_shard_plan(plan_, run());
    std::string text = read_file(run() + "/plan.json");
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    write_file(run() + "/plan.json", text.replace(at, from.size(), to));
    return test::thrown_message<InputError>([&] { static_cast<void>(read_shard_plan(run())); });
  }

  test::ScratchFolder folder_;
  ShardPlan plan_;
};

TEST_F(PlanFile, IsReadAsItWasWritten) {
  const ShardPlan read = read_shard_plan(run());
  EXPECT_EQ(read.program, plan_.program);
  EXPECT_EQ(read.suite_hash, plan_.suite_hash);
  EXPECT_EQ(read.costs, plan_.costs);
  ASSERT_EQ(read.clips.size(), 1U);
  EXPECT_EQ(read.clips[0].file, "clips/000000.npz");
  ASSERT_EQ(read.shards.size(), 2U);
  EXPECT_EQ(read.shards[1].begin, 2);
  EXPECT_EQ(read.shards[1].cost, 1.5);
  EXPECT_EQ(read.shards[1].keys, "k2");
  EXPECT_EQ(shard_of(read, 1).begin, 2);
}

TEST_F(PlanFile, RefusesWhatIsNoPlan) {
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { static_cast<void>(read_shard_plan(folder_ / "none")); }));
  EXPECT_SENTENCE(refusal_with("duet.plan/1", "duet.plan/9"));
  EXPECT_SENTENCE(refusal_with("\"episodes\",", "\"episode\","));
  EXPECT_SENTENCE(refusal_with("\"duet\":", "\"dwet\":"));
  EXPECT_SENTENCE(refusal_with("\"episodes\": 4", "\"episodes\": 5"));
  EXPECT_SENTENCE(refusal_with("\"begin\": 2", "\"begin\": 1"));
  EXPECT_SENTENCE(refusal_with("\"end\": 2", "\"end\": 0"));
  EXPECT_SENTENCE(refusal_with("\"cost_s\": 1.25", "\"cost_s\": -1.25"));
  EXPECT_SENTENCE(refusal_with("clips/000000.npz", "../000000.npz"));
  EXPECT_SENTENCE(refusal_with("\"shards\":", "\"shard\":"));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { static_cast<void>(shard_of(plan_, 2)); }));
}

TEST_F(PlanFile, AnotherProgramIsRefusedByItsDigest) {
  ProgramDigests here = plan_.program;
  require_same_program(plan_.program, here, run());
  here["mujoco"] = std::string(64, 'd');
  const auto refusal = [&] {
    return test::thrown_message<InputError>([&] { require_same_program(plan_.program, here, run()); });
  };
  EXPECT_SENTENCE(refusal());
  here.erase("mujoco");
  EXPECT_SENTENCE(refusal());
  here["duet"] = "feed";
  EXPECT_SENTENCE(refusal());
}

TEST(ProgramDigests, AreOfThisProgramAndItsEngines) {
  const ProgramDigests digests = program_digests({"playback", "no_such_engine_is_absent"});
  EXPECT_EQ(digests.at("duet").size(), 64U);
  EXPECT_FALSE(digests.contains("playback"));
  EXPECT_EQ(digests.at("no_such_engine_is_absent"), "");
}

}  // namespace
}  // namespace duet
