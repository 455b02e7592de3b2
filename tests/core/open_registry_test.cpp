#include <atomic>
#include <thread>

#include "duet/core/names.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

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

}  // namespace
}  // namespace duet
