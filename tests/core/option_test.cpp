
#include <stdexcept>

#include "duet/core/field.h"
#include "tests/support.h"

namespace duet {
namespace {

enum class Mode { kCalm, kFast };

struct Fan {
  Mode mode = Mode::kCalm;
  int blades = 3;
  std::optional<double> speed = {};
};

const FieldTable<Fan>& fan_fields() {
  static const FieldTable<Fan> table = {
      field<Fan>({.name = "mode", .meaning = "how it blows", .choices = {"calm", "fast"}}, &Fan::mode),
      field<Fan>({.name = "blades", .meaning = "how many", .range = {2, 5}}, &Fan::blades),
      field<Fan>({.name = "speed", .meaning = "of the tips", .unit = "m/s", .range = {0.0, 90.0}}, &Fan::speed)};
  return table;
}

Fan read(const std::map<std::string, std::string>& given) { return read_options("fan", "desk", fan_fields(), given); }

std::string refusal(const std::map<std::string, std::string>& given) {
  return test::thrown_message<std::invalid_argument>([&] { read(given); });
}

TEST(Options, ThatAreNotGivenKeepTheirDefaults) {
  const Fan still = read({});
  EXPECT_EQ(still.mode, Mode::kCalm);
  EXPECT_EQ(still.blades, 3);
  EXPECT_FALSE(still.speed);
  const Fan fast = read_options("fan", "desk", fan_fields(), {{"speed", "12.5"}}, {.mode = Mode::kFast, .blades = 4});
  EXPECT_EQ(fast.mode, Mode::kFast);
  EXPECT_EQ(fast.blades, 4);
  EXPECT_EQ(fast.speed, 12.5);
}

TEST(Options, AreRefusedWithWhoseTheyAreAndWhatWasExpected) {
  EXPECT_SENTENCE(refusal({{"blades", "6"}}));
  EXPECT_SENTENCE(refusal({{"speed", "nan"}}));
  EXPECT_SENTENCE(refusal({{"mode", "fats"}}));
  EXPECT_SENTENCE(refusal({{"blade", "3"}}));
}

TEST(Options, AreListedWithValuesDefaultAndMeaning) {
  struct Row {
    std::string name, fallback, about;
  };
  const std::vector<Row> rows = option_list<Row>(fan_fields());
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_EQ(rows[0].about, "calm, fast; how it blows");
  EXPECT_EQ(rows[1].fallback, "3");
  EXPECT_EQ(rows[2].fallback, "");
}

}  // namespace
}  // namespace duet
