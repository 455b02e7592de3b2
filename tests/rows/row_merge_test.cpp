// A merge is a set union: order, grouping and repetition of its sources do not matter, however little memory it has.
#include "duet/rows/merge/row_merge.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <map>

#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/rows/json_fields.h"
#include "tests/file_size_limit.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

class RowMerge : public testing::Test {
 protected:
  // A file of rows; a name for the source.
  RowSource source(const std::string& name, const std::vector<EpisodeRow>& rows, const std::string& node = "") const {
    std::string text;
    for (const EpisodeRow& row : rows) text += dumped(to_json(row)) + "\n";
    write_file(folder_ / name, text);
    return {.path = folder_ / name, .from = name, .run = 0, .shard = -1, .node = node};
  }
  std::string merged(const std::vector<RowSource>& sources, std::size_t entries = 150'000) const {
    result_ = merge_rows(sources, test::tiny_run(), folder_ / "merged", {.entries = entries});
    return result_.violations == 0 ? read_file(folder_ / "merged") : "(differences)";
  }
  std::string refusal(const std::vector<RowSource>& sources) const {
    return test::thrown_message<InputError>([&] { merged(sources); });
  }

  test::ScratchFolder folder_;
  mutable MergedRows result_;
};

EpisodeRow row_number(int number) {
  EpisodeRow row = test::engine_episode(number % 2 == 0 ? "mujoco" : "ode", "replay", number, number % 3 == 0);
  row.metrics["jpe"] = 0.1 * number;
  return row;
}

// The same episode as some machine ran it: another time, and now and then an error or a time-out.
EpisodeRow as_run(int number, Random& random) {
  EpisodeRow row = row_number(number);
  row.started_at = "2026-01-02T03:04:0" + std::to_string(random.below(3)) + "Z";
  row.wall_s = 0.5 * random.below(4);
  if (!random.chance(0.3)) return row;
  row.outcome = random.chance(0.5) ? Outcome::kError : Outcome::kTimedOut;
  row.success = false;
  row.message = "killed its worker " + std::to_string(random.below(3)) + " times";
  row.metrics.clear();
  return row;
}

std::vector<EpisodeRow> some_rows(Random& random) {
  std::vector<EpisodeRow> rows;
  for (int i = random.below(12); i > 0; --i) rows.push_back(as_run(random.below(10), random));
  return rows;
}

TEST_F(RowMerge, IsAssociativeCommutativeAndIdempotent) {
  for (std::uint64_t seed = 0; seed < 15; ++seed) {
    Random random(seed, 1);
    const RowSource a = source("a", some_rows(random)), b = source("b", some_rows(random));
    const RowSource c = source("c", some_rows(random));
    const std::string all = merged({a, b, c});
    std::vector<RowSource> order = {a, b, c};
    const auto by_path = [](const RowSource& x, const RowSource& y) { return x.path < y.path; };
    do {
      EXPECT_EQ(merged(order, 1 + static_cast<std::size_t>(random.below(5))), all) << seed;
    } while (std::next_permutation(order.begin(), order.end(), by_path));
    write_file(folder_ / "ab", merged({a, b}, 2));
    write_file(folder_ / "bc", merged({b, c}, 2));
    write_file(folder_ / "abc", all);
    const auto file = [&](const char* name) {
      return RowSource{.path = folder_ / name, .from = name, .run = 0, .shard = -1, .node = {}};
    };
    EXPECT_EQ(merged({file("ab"), c}), all) << seed;
    EXPECT_EQ(merged({a, file("bc")}), all) << seed;
    EXPECT_EQ(merged({file("abc")}), all) << seed;
    EXPECT_EQ(merged({file("abc"), a, file("abc")}, 3), all) << seed;
  }
}

TEST_F(RowMerge, HasEachEpisodeOnceAndAMishapOnlyWhereNothingElseIs) {
  for (std::uint64_t seed = 100; seed < 120; ++seed) {
    Random random(seed, 1);
    const std::vector<EpisodeRow> first = some_rows(random), second = some_rows(random);
    std::map<std::string, Outcome> wanted;
    for (const auto* rows : {&first, &second})
      for (const EpisodeRow& row : *rows) {
        const auto [known, is_new] = wanted.try_emplace(row.key, row.outcome);
        if (known->second == Outcome::kError || row.outcome == Outcome::kOk) known->second = row.outcome;
      }
    const std::string text = merged({source("a", first), source("b", second)}, 4);
    std::map<std::string, Outcome> found;
    for (std::size_t begin = 0, end = 0; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1) {
      const EpisodeRow row = row_from_json(parse_json(text.substr(begin, end - begin), "row"));
      EXPECT_TRUE(found.try_emplace(row.key, row.outcome).second);
    }
    EXPECT_EQ(found, wanted) << seed;
    EXPECT_EQ(result_.rows, std::ssize(wanted));
    EXPECT_EQ(result_.rows + result_.folded + result_.superseded, std::ssize(first) + std::ssize(second));
  }
}

// Two attempts at one shard: a node without the engine, and one that has it.
TEST_F(RowMerge, ARowOfANodeWithoutTheEngineGivesWayToOneThatRan) {
  const EpisodeRow ran = row_number(3);
  EpisodeRow lacking = row_number(3), elsewhere = row_number(3);
  for (EpisodeRow* row : {&lacking, &elsewhere}) {
    row->outcome = Outcome::kUnsupported;
    row->success = false;
    row->metrics.clear();
  }
  lacking.message = "this machine has no ode";
  elsewhere.message = "libode.so.8: cannot open shared object file";
  const RowSource one = source("one", {lacking, row_number(4)}, "n1"), two = source("two", {ran}, "n2");
  const RowSource three = source("three", {elsewhere}, "n3");
  const std::string alone = merged({two, source("four", {row_number(4)})});
  for (const std::vector<RowSource>& order : {std::vector{one, two, three}, std::vector{three, two, one}}) {
    EXPECT_EQ(merged(order), alone);
    EXPECT_EQ(result_.violations, 0);
    EXPECT_EQ(result_.superseded, 2);
  }
  merged({one, three});  // nobody has it: their words for it need not agree
  EXPECT_EQ(result_.violations, 0);
  EXPECT_EQ(result_.rows, 2);
}

TEST_F(RowMerge, RowsThatDifferAreToldNodeByNodeAndNothingIsWritten) {
  EpisodeRow changed = row_number(2);
  changed.fell = true;
  const RowSource one = source("one", {row_number(1), row_number(2)}, "n1");
  const RowSource two = source("two", {row_number(1), changed}, "n2");
  EXPECT_EQ(merged({one, two}), "(differences)");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "merged"));
  EXPECT_EQ(result_.violations, 1);
  ASSERT_EQ(result_.conflicts.size(), 1U);
  EXPECT_SENTENCE(result_.conflicts.front());
  ASSERT_EQ(result_.agreement.size(), 1U);
  EXPECT_EQ(result_.agreement.begin()->first, NodePair("n1", "n2"));
  EXPECT_EQ(result_.agreement.begin()->second.compared, 2);
  EXPECT_EQ(result_.agreement.begin()->second.different, 1);
}

TEST_F(RowMerge, RowsWrittenInTwoWaysAreEqual) {
  const RowSource one = source("one", {row_number(1)});
  std::string text = read_file(one.path);
  text.replace(text.find("\"fell\":false"), 12, "\"fell\": false");
  write_file(folder_ / "two", text);
  merged({one, {.path = folder_ / "two", .from = "two", .run = 0, .shard = -1, .node = {}}});
  EXPECT_EQ(result_.violations, 0);
  EXPECT_EQ(result_.folded, 1);
}

TEST_F(RowMerge, ATornLastLineIsLeftOut) {
  const RowSource one = source("one", {row_number(1)});
  test::append_text(one.path, dumped(to_json(row_number(2))).substr(0, 200));
  const std::string text = merged({one});
  EXPECT_EQ(std::ranges::count(text, '\n'), 1);
  EXPECT_EQ(result_.torn, 1);
  EXPECT_EQ(result_.rows, 1);
}

TEST_F(RowMerge, AFileThatIsNotThereHasNoRows) {
  merged({{.path = folder_ / "nothing", .from = "nothing", .run = 0, .shard = -1, .node = {}}});
  EXPECT_EQ(result_.rows, 0);
  EXPECT_EQ(read_file(folder_ / "merged"), "");
}

TEST_F(RowMerge, CountsByRunShardAndNode) {
  RowSource one = source("one", {row_number(1), row_number(2)}, "n1");
  RowSource two = source("two", {row_number(2), row_number(3)}, "n2");
  one.shard = 0;
  two.run = two.shard = 1;
  merged({one, two});
  EXPECT_EQ(result_.of_run, (std::map<int, std::int64_t>{{0, 2}, {1, 2}}));
  EXPECT_EQ(result_.of_shard, (std::map<int, std::int64_t>{{0, 2}, {1, 2}}));
  EXPECT_EQ(result_.of_node, (std::map<std::string, std::int64_t>{{"n1", 2}, {"n2", 1}}));
}

TEST_F(RowMerge, RefusesRowsThatDoNotBelongThere) {
  const RowSource good = source("good", {row_number(1)});
  write_file(folder_ / "broken", "{\"schema\":5}\n");
  EXPECT_SENTENCE(refusal({good, {.path = folder_ / "broken", .from = "b", .run = 0, .shard = -1, .node = {}}}));
  EpisodeRow foreign = row_number(2);
  foreign.suite_hash = "feedfeed";
  foreign.key = episode_key(foreign);
  EXPECT_SENTENCE(refusal({source("foreign", {foreign})}));
  EpisodeRow renamed = row_number(2);
  renamed.policy_digest = std::string(64, 'a');
  renamed.key = episode_key(renamed);
  EXPECT_SENTENCE(refusal({good, source("renamed", {renamed})}));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "merged"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_ / "."), {}), 4);  // the sources, nothing else
}

// Sources are read on several threads; which one fails first must not matter.
TEST_F(RowMerge, OfSeveralBrokenSourcesTheFirstIsNamed) {
  std::vector<RowSource> sources;
  for (int i = 0; i < 12; ++i) {
    const std::string name = "s" + std::to_string(i);
    if (i % 4 == 3) {
      write_file(folder_ / name, "{\"schema\":5}\n");
      sources.push_back({.path = folder_ / name, .from = name, .run = 0, .shard = -1, .node = {}});
    } else {
      sources.push_back(source(name, {row_number(i)}));
    }
  }
  for (int repetition = 0; repetition < 20; ++repetition) EXPECT_SENTENCE(refusal(sources));
}

TEST_F(RowMerge, AFolderThatCannotBeWrittenIsAStorageError) {
  const RowSource good = source("good", {row_number(1)});
  EXPECT_SENTENCE(
      test::thrown_message<StorageError>([&] { merge_rows({good}, test::tiny_run(), folder_ / "no/such/merged"); }));
}

TEST_F(RowMerge, ADiskThatFillsUpLeavesWhatWasThere) {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 2000; ++i) rows.push_back(row_number(i));
  const std::vector<RowSource> sources = {source("many", rows)};
  write_file(folder_ / "merged", "before");
  ASSERT_GT(std::filesystem::file_size(folder_ / "many"), 1U << 20U);
  {
    const test::FileSizeLimit limit(1U << 20U);
    EXPECT_SENTENCE(test::thrown_message<StorageError>([&] { merged(sources); }));
  }
  EXPECT_EQ(read_file(folder_ / "merged"), "before");
  const auto entries = std::filesystem::directory_iterator(folder_ / "");
  EXPECT_EQ(std::distance(begin(entries), end(entries)), 2);
  EXPECT_EQ(read_file(folder_ / "many").size(), merged(sources).size());
}

}  // namespace
}  // namespace duet
