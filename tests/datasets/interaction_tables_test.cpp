#include "duet/datasets/interaction_tables.h"

#include <gtest/gtest.h>

#include "duet/core/numbers.h"

namespace duet {
namespace {

InteractionSet set_of(const std::string& name, double touch_s) {
  InteractionSet set{.name = name, .tasks = {Task::kHug, Task::kWave}, .clips = {}};
  set.clips = {{.seconds = 2.0, .touches = 1.0, .touch_s = touch_s}, {.seconds = 3.0, .touches = 1.0, .touch_s = 9.0}};
  return set;
}

const std::vector<std::string>& row_of(const TextTable& table, const std::string& title) {
  for (const std::vector<std::string>& row : table.rows)
    if (row[0] == title) return row;
  throw std::runtime_error(title);
}

TEST(InteractionTables, AreOfOneTask) {
  const TextTable table = interaction_table(std::vector{set_of("made", 1.5)}, Task::kHug);
  EXPECT_EQ(table.header, (std::vector<std::string>{"hug", "unit", "made"}));
  EXPECT_EQ(row_of(table, "Clips"), (std::vector<std::string>{"Clips", "", "1"}));
  EXPECT_EQ(row_of(table, "Time in touch").back(), "1.50 1.50 1.50");
  EXPECT_EQ(row_of(table, "Height of the touch").back(), "-");
}

TEST(InteractionTables, MarkWhatIsApart) {
  const TextTable table = interaction_table(set_of("made", 1.5), set_of("recorded", 1.0), Task::kHug);
  EXPECT_EQ(row_of(table, "Time in touch"),
            (std::vector<std::string>{"Time in touch", "s", "1.50 1.50 1.50", "1.00 1.00 1.00", "1.50", "*"}));
  EXPECT_EQ(row_of(table, "Length of the clip").back(), "");
  EXPECT_EQ(row_of(table, "Height of the touch")[4], "-");
  EXPECT_EQ(row_of(table, "Clips with a touch or gesture")[4], "+0.00");
}

TEST(InteractionTables, CountWhatAgrees) {
  const InteractionAgreement found = interaction_agreement(set_of("made", 1.5), set_of("recorded", 1.0), Task::kHug);
  EXPECT_EQ(found.compared, 3);  // length, touches, time in touch
  EXPECT_EQ(found.agreeing, 2);
}

// `count` clips of a task whose touch lasts for about `touch_s`, give or take half a second.
InteractionSet drawn_set(const std::string& name, double touch_s, int count, std::uint64_t stream) {
  InteractionSet set{.name = name, .tasks = std::vector<Task>(count, Task::kHug), .clips = {}};
  Random random(3, stream);
  for (int i = 0; i < count; ++i)
    set.clips.push_back({.seconds = 2.0 + random.normal(), .touches = 1.0, .touch_s = touch_s + 0.5 * random.normal()});
  return set;
}

TEST(InteractionTables, SeveralSetsStandSideBySide) {
  const TextTable table =
      interaction_table(std::vector{set_of("made", 1.5), set_of("one", 1.0), set_of("two", 2.0)}, Task::kHug);
  EXPECT_EQ(table.header, (std::vector<std::string>{"hug", "unit", "made", "one", "two"}));
  EXPECT_EQ(row_of(table, "Time in touch"),
            (std::vector<std::string>{"Time in touch", "s", "1.50 1.50 1.50", "1.00 1.00 1.00", "2.00 2.00 2.00"}));
}

TEST(InteractionTables, TellTheFirstSetApartAndTheOthersFromEachOther) {
  const std::vector<InteractionSet> sets = {drawn_set("made", 4.0, 40, 1), drawn_set("one", 1.0, 40, 2),
                                            drawn_set("two", 1.0, 40, 3)};
  const TextTable table = told_apart_table(sets, Task::kHug);
  const auto area = [&](const char* title) { return std::stod(row_of(table, title)[1]); };
  EXPECT_GT(area("made / the others"), 0.95);
  EXPECT_NEAR(area("one / the rest of them"), 0.5, 0.2);
  EXPECT_NEAR(area("halves of the others"), 0.5, 0.1);
  EXPECT_EQ(row_of(table, "made / the others")[2], "-");  // no windows
  EXPECT_NE(told_by(sets, Task::kHug).find("Time in touch (more)"), std::string::npos) << told_by(sets, Task::kHug);
}

TEST(InteractionTables, TooFewClipsAreNotTold) {
  const std::vector<InteractionSet> sets = {drawn_set("made", 4.0, 40, 1), drawn_set("one", 1.0, 7, 2)};
  EXPECT_EQ(told_apart_table(sets, Task::kHug).rows[0][1], "-");
  EXPECT_EQ(told_by(sets, Task::kHug), "");
}

}  // namespace
}  // namespace duet
