#include "duet/datasets/interaction_tables.h"

#include <gtest/gtest.h>

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
  const TextTable table = interaction_table(set_of("made", 1.5), Task::kHug);
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

}  // namespace
}  // namespace duet
