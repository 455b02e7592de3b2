#include "duet/core/names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "duet/core/named_values.h"
#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

const std::vector<std::string> kKnown = {"hug", "handshake", "high_five", "wave", "bend", "fly_kiss"};

TEST(ClosestName, FindsOneSlipOfEachKind) {
  EXPECT_EQ(closest_name("hugg", kKnown), "hug");
  EXPECT_EQ(closest_name("handshke", kKnown), "handshake");
  EXPECT_EQ(closest_name("wabe", kKnown), "wave");
  EXPECT_EQ(closest_name("bned", kKnown), "bend");
}

TEST(ClosestName, IgnoresCaseAndTheKindOfDash) {
  EXPECT_EQ(closest_name("HIGH-FIVE", kKnown), "high_five");
  EXPECT_EQ(closest_name("Fly-Kis", kKnown), "fly_kiss");
}

TEST(ClosestName, CountsASwapOfNeighboursOnce) {
  // Without it "abcdef" <- "badcfe" would be 6 edits and out of reach; with it there are 3, which is above 6 / 3.
  EXPECT_EQ(closest_name("badcef", std::vector<std::string>{"abcdef"}), "abcdef");
  EXPECT_EQ(closest_name("badcfe", std::vector<std::string>{"abcdef"}), "");
}

TEST(ClosestName, IsEmptyWhereNothingIsNear) {
  EXPECT_EQ(closest_name("somersault", kKnown), "");
  EXPECT_EQ(closest_name("", kKnown), "");
  EXPECT_EQ(closest_name("hug", {}), "");
  EXPECT_EQ(closest_name("zz", std::vector<std::string>{"ab"}), "");  // two edits, and nothing shared
}

TEST(ClosestName, ReachesAThirdOfTheLength) {
  const std::vector<std::string> known = {"abcdefghijkl"};
  EXPECT_EQ(closest_name("abcdefghXXXX", known), "abcdefghijkl");  // 4 of 12
  EXPECT_EQ(closest_name("abcdefgXXXXX", known), "");              // 5 of 12
}

TEST(UnknownNameMessage, AsksOnlyWhereANameIsNear) {
  EXPECT_SENTENCE(unknown_name_message("task", "hugg", kKnown));
  EXPECT_SENTENCE(unknown_name_message("task", "somersault", kKnown));
  EXPECT_SENTENCE(unknown_name_message("engine", "x", {}));
}

TEST(UnknownNameMessage, OfALongListShowsTheNearest) {
  std::vector<std::string> known;
  for (int i = 0; i < 44; ++i) known.push_back("link_" + std::to_string(i));
  EXPECT_SENTENCE(unknown_name_message("frame", "lnk_43", known));
}

TEST(Names, OptionThatIsNotGivenFallsBack) {
  const std::map<std::string, std::string> options = {{"waist", "locked"}};
  EXPECT_EQ(option_or(options, "waist", "free"), "locked");
  EXPECT_EQ(option_or(options, "engine", "duet"), "duet");
  EXPECT_EQ(option_or(options, "language"), "");
}

TEST(PlainName, HasLettersDigitsAndFourSigns) {
  for (const char* name : {"a", "kick_0.5", "push+delay", "A-1"}) EXPECT_TRUE(is_plain_name(name)) << name;
  // The last two are a formula of a spreadsheet, an option of a command line.
  for (const char* name : {"", "a b", "a/b", "a,b", "\xc3\xa4", "=1+2", "@a", "+1", "-2+3"})
    EXPECT_FALSE(is_plain_name(name)) << name;
  EXPECT_SENTENCE(plain_name_message("a b"));
}

TEST(SyntheticId, NamesWhatTheClipWasDrawnFrom) {
  EXPECT_EQ(synthetic_clip_id("people", "high_five", 42, 7), "people-high_five-s42-0007");
  EXPECT_EQ(synthetic_clip_id("synth", "hug", 0, 12345), "synth-hug-s0-12345");
}

TEST(SyntheticId, AnotherRoleHasAnotherIdAndBackTheFirstOne) {
  for (const std::string id : {"wave-7", "A", "-A", "wave-A", "wave-B"})
    for (const char before : {'A', 'B'}) {
      const std::string other = id_in_other_role(id, before);
      EXPECT_NE(other, id);
      EXPECT_EQ(id_in_other_role(other, before == 'A' ? 'B' : 'A'), id) << id << " " << before;
    }
  EXPECT_EQ(id_in_other_role("wave-7", 'A'), "wave-7-B");
  EXPECT_EQ(id_in_other_role("wave-7-B", 'B'), "wave-7");
  EXPECT_EQ(tracked_clip_id("wave-7"), "wave-7-tracked");
}

struct Item {
  std::string name;
  int value = 0;
};

TEST(OpenRegistry, KeepsWhatIsAddedInOrderAndAtOnePlace) {
  OpenRegistry<Item> registry;
  registry.add("item", {"a", 1}, {});
  const Item* first = registry.find("a");
  for (int i = 0; i < 100; ++i) registry.add("item", {"b" + std::to_string(i), i}, {});
  EXPECT_EQ(registry.find("a"), first);
  EXPECT_EQ(first->value, 1);
  EXPECT_EQ(registry.find("c"), nullptr);
  ASSERT_EQ(registry.all().size(), 101u);
  EXPECT_EQ(registry.all()[1]->name, "b0");
}

TEST(OpenRegistry, RefusesANameThatIsTakenEmptyOrADescriptors) {
  OpenRegistry<Item> registry;
  registry.add("item", {"mine"}, {"theirs"});
  for (const char* name : {"mine", "theirs"})
    EXPECT_EQ(thrown_message<std::invalid_argument>([&] { registry.add("item", {name}, {"theirs"}); }),
              std::string("item '") + name + "' is there already: choose another name");
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { registry.add("item", {""}, {}); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { registry.add("item", {"my.yaml"}, {}); }));
  EXPECT_EQ(registry.all().size(), 1u);
}

TEST(OpenRegistry, OfTwoThreadsThatAddOneNameOneSucceeds) {
  for (int round = 0; round < 50; ++round) {
    OpenRegistry<Item> registry;
    std::atomic<int> refused = 0;
    const auto add = [&] {
      try {
        registry.add("item", {"one"}, {});
      } catch (const std::invalid_argument&) {
        ++refused;
      }
    };
    std::thread other(add);
    add();
    other.join();
    EXPECT_EQ(refused, 1);
    EXPECT_EQ(registry.all().size(), 1u);
  }
}

using Map = std::map<std::string, double>;

Map some_values(Random& random) {
  Map values;
  for (int i = random.below(6); i > 0; --i) values["metric_" + std::to_string(random.below(8))] = random.below(4);
  return values;
}

// Its model is std::map.
TEST(NamedValues, AreWhatAMapIs) {
  Random random(7, 1);
  NamedNumbers values;
  Map model;
  for (int step = 0; step < 2000; ++step) {
    const std::string name = "metric_" + std::to_string(random.below(8));
    switch (random.below(5)) {
      case 0:
        values[name] += 0.5;
        model[name] += 0.5;
        break;
      case 1:
        values.erase(name);
        model.erase(name);
        break;
      case 2:
        model = some_values(random);
        values = model;
        break;
      case 3: {
        NamedNumbers copy = values;
        copy["other"] = 1.0;
        EXPECT_FALSE(copy == values);
        copy = values;
        values = std::move(copy);
        break;
      }
      default:
        EXPECT_EQ(values.contains(name), model.contains(name));
        EXPECT_EQ(values.find(name) == values.end(), model.find(name) == model.end());
        if (model.contains(name)) {
          EXPECT_EQ(values.find(name)->second, model.at(name));
        }
        EXPECT_EQ(values.lower_bound(name) == values.end(), model.lower_bound(name) == model.end());
    }
    ASSERT_EQ(values.map(), model);
    EXPECT_EQ(values.size(), model.size());
    EXPECT_EQ(values == NamedNumbers(model), true);
  }
  values.clear();
  EXPECT_TRUE(values.empty());
  EXPECT_THROW(static_cast<void>(values.at("metric_0")), std::out_of_range);
}

TEST(NamedValues, ShareTheNamesOfAPoolAndKeepTheirValues) {
  NamePool pool;
  NamedNumbers a = {{"jpe", 0.5}, {"awd", 0.25}}, b = {{"awd", 1.0}, {"jpe", 2.0}};
  a.share_names(pool);
  b.share_names(pool);
  EXPECT_EQ(&a.begin()->first, &b.begin()->first);
  EXPECT_EQ(a.map(), (Map{{"awd", 0.25}, {"jpe", 0.5}}));
  a["new"] = 3.0;
  EXPECT_EQ(b.map(), (Map{{"awd", 1.0}, {"jpe", 2.0}}));
}

}  // namespace
}  // namespace duet
