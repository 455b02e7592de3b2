#include "duet/core/field.h"

#include <gmock/gmock.h>

#include <stdexcept>

#include "tests/support.h"

namespace duet {
namespace {

using ::testing::ElementsAre;

enum class Gait { kStand, kWalk, kRun };

struct Walk {
  double speed = 0.5;
  double longest = 2.0;
  int steps = 3;
  std::uint64_t seed = 42;
  bool backwards = false;
  std::string name;
  Gait gait = Gait::kWalk;
  std::optional<double> turn;
};

const FieldTable<Walk>& walk_fields() {
  static const FieldTable<Walk> table = {
      field<Walk>({.name = "speed", .meaning = "over the ground", .unit = "m/s", .range = {0.0, 3.0, false}},
                  &Walk::speed),
      field<Walk>({.name = "longest", .range = {0.0, 9.0}}, &Walk::longest, &Walk::speed),
      field<Walk>({.name = "steps", .range = {1, 10}}, &Walk::steps),
      field<Walk>({.name = "seed"}, &Walk::seed),
      field<Walk>({.name = "backwards"}, &Walk::backwards),
      field<Walk>({.name = "name"}, &Walk::name),
      field<Walk>({.name = "gait", .choices = {"stand", "walk", "run"}}, &Walk::gait),
      field<Walk>(
          {.name = "turn", .range = {-1.0, 1.0}}, [](auto& walk) -> auto& { return walk.turn; })};
  return table;
}

std::string set(Walk& walk, const std::string& name, const std::string& text) {
  return set_field(*find_field(walk_fields(), name), walk, text);
}

TEST(Field, EachKindReadsWhatItWrites) {
  Walk walk;
  for (const auto& [name, text] : std::vector<std::pair<std::string, std::string>>{{"speed", "0.1"},
                                                                                   {"steps", "10"},
                                                                                   {"seed", "9000000000000000"},
                                                                                   {"backwards", "true"},
                                                                                   {"name", "a b"},
                                                                                   {"gait", "run"},
                                                                                   {"turn", "-1"}}) {
    EXPECT_NE(find_field(walk_fields(), name)->text(walk), text) << name;
    EXPECT_EQ(set(walk, name, text), "") << name;
    EXPECT_EQ(find_field(walk_fields(), name)->text(walk), text) << name;
  }
  EXPECT_EQ(walk.gait, Gait::kRun);
  EXPECT_EQ(walk.seed, 9'000'000'000'000'000U);
  EXPECT_EQ(walk.turn, -1.0);
}

TEST(Field, NumbersAreHeldAgainstTheirRange) {
  Walk walk;
  for (const char* bad : {"0", "-1", "3.0001", "nan", "inf", "", " 1", "1x", "+-1", "+"})
    EXPECT_EQ(set(walk, "speed", bad), "a number above 0, at most 3 m/s") << bad;
  EXPECT_EQ(walk.speed, 0.5);
  EXPECT_EQ(set(walk, "speed", "3"), "");
  EXPECT_EQ(set(walk, "speed", "+1e-3"), "");
  EXPECT_EQ(walk.speed, 1e-3);
  EXPECT_EQ(set(walk, "turn", "-1"), "");
  EXPECT_EQ(set(walk, "turn", "-1.1"), "a number from -1, at most 1");
}

TEST(Field, WholeNumbersAreWhole) {
  Walk walk;
  for (const char* bad : {"0", "11", "1.5", "x"}) EXPECT_EQ(set(walk, "steps", bad), "a whole number, 1 to 10") << bad;
  EXPECT_EQ(set(walk, "steps", "1"), "");
  EXPECT_EQ(set(walk, "steps", "1e1"), "");
  EXPECT_EQ(walk.steps, 10);
  EXPECT_EQ(set(walk, "seed", "-4"), "a whole number, 0 to 9000000000000000");
  EXPECT_EQ(set(walk, "seed", "9000000000000002"), "a whole number, 0 to 9000000000000000");
}

TEST(Field, FlagsHaveTheWordsOfYaml) {
  Walk walk;
  for (const char* on : {"true", "on", "Yes", "TRUE"}) {
    walk.backwards = false;
    EXPECT_EQ(set(walk, "backwards", on), "") << on;
    EXPECT_TRUE(walk.backwards) << on;
  }
  EXPECT_EQ(set(walk, "backwards", "no"), "");
  EXPECT_FALSE(walk.backwards);
  EXPECT_EQ(set(walk, "backwards", "2"), "true or false");
}

TEST(Field, ANumberMayBeBoundByAnotherField) {
  Walk walk;
  walk.speed = 2.5;
  const Field<Walk>& longest = *find_field(walk_fields(), "longest");
  EXPECT_EQ(set_field(longest, walk, "2.4"), "a number from 2.5, at most 9");
  raise_default(longest, walk);
  EXPECT_EQ(walk.longest, 2.5);
  walk.longest = 4.0;
  raise_default(longest, walk);
  EXPECT_EQ(walk.longest, 4.0);
}

TEST(Field, ARefusalHasKeyExpectedAndFound) {
  const Field<Walk>& speed = *find_field(walk_fields(), "speed");
  EXPECT_SENTENCE(field_refusal(speed, speed.values, "9"));
  EXPECT_SENTENCE(field_refusal(speed, speed.values, "fast"));
  EXPECT_SENTENCE(field_refusal(*find_field(walk_fields(), "gait"), "", "wakl"));
}

TEST(Field, ATableListsAndWritesItself) {
  const Walk walk;
  EXPECT_EQ(flow_mapping(walk_fields(), walk),
            "{speed: 0.5, longest: 2, steps: 3, seed: 42, backwards: false, gait: walk}");
  EXPECT_THAT(field_names(walk_fields()),
              ElementsAre("speed", "longest", "steps", "seed", "backwards", "name", "gait", "turn"));
  const std::vector<FieldRow> rows = field_rows(walk_fields(), walk);
  EXPECT_EQ(rows[0].values, "a number above 0, at most 3 m/s");
  EXPECT_EQ(rows[0].fallback, "0.5");
  EXPECT_EQ(rows[0].meaning, "over the ground");
  EXPECT_EQ(rows[2].values, "a whole number, 1 to 10");
  EXPECT_EQ(rows[5].values, "a text");
  EXPECT_EQ(rows[6].values, "stand, walk, run");
  EXPECT_EQ(rows[7].fallback, "");
  EXPECT_EQ(find_field(walk_fields(), "sped"), nullptr);
}

TEST(Field, OpenRangesAreSaidInWords) {
  EXPECT_EQ(values_of_number({}, "m"), "a finite number");
  EXPECT_EQ(values_of_number({.low = 0.0}, ""), "a finite number, zero or more");
  EXPECT_EQ(values_of_number({.low = 0.0, .with_low = false}, "s"), "a finite number above 0 s");
  EXPECT_EQ(values_of_number({.high = 2.0}, "s"), "a finite number, at most 2 s");
  EXPECT_EQ(values_of_whole({.low = 0.0}, -2147483648.0, 2147483647.0), "a whole number, 0 to 2147483647");
}

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
