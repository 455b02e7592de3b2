#include "duet/core/named_values.h"

#include <gmock/gmock.h>

#include "duet/core/numbers.h"

namespace duet {
namespace {

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
