#include "duet/robots/yaml_schema.h"

#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "duet/robots/yaml_section.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

struct Wheel {
  int line = 0;
  double radius = 0.0;
  std::vector<double> offsets = {1.0};
};

struct Cart {
  enum class Drive { kFront, kRear } drive = Drive::kRear;
  std::string name;
  int seats = 2;
  bool roofed = true;
  std::vector<std::string> owners;
  Wheel wheel;
  std::optional<Wheel> spare;
  std::optional<double> load;
};

const Schema<Cart>& cart_schema() {
  static const Schema<Wheel> wheel = {required_key({.name = "radius", .range = kPositive}, &Wheel::radius),
                                      optional_key({"offsets"}, &Wheel::offsets)};
  static const Schema<Cart> schema = {required_key({"name"}, &Cart::name),
                                      optional_key({.name = "drive", .choices = {"front", "rear"}}, &Cart::drive),
                                      optional_key({.name = "seats", .range = {1, 9}}, &Cart::seats),
                                      optional_key({.name = "roof", .choices = {"open", "closed"}}, &Cart::roofed),
                                      optional_key({"owners"}, &Cart::owners),
                                      mapping_key("wheel", &Cart::wheel, wheel),
                                      mapping_key("spare", &Cart::spare, wheel),
                                      optional_key({.name = "load", .range = kNotNegative}, &Cart::load)};
  return schema;
}

Cart read_cart(const std::string& text) {
  Cart cart;
  read_mapping("c.yaml", parse_yaml(text, "c.yaml"), "cart", cart_schema(), cart);
  return cart;
}

std::string cart_refusal(const std::string& text) {
  return test::thrown_message<InputError>([&] { read_cart("name: a\n" + text); });
}

TEST(YamlSchema, WhatIsNotNamedKeepsItsValue) {
  const Cart cart = read_cart("name: a\n");
  EXPECT_EQ(cart.drive, Cart::Drive::kRear);
  EXPECT_EQ(cart.seats, 2);
  EXPECT_TRUE(cart.roofed);
  EXPECT_FALSE(cart.spare.has_value());
  EXPECT_FALSE(cart.load.has_value());
  EXPECT_EQ(cart.wheel.offsets, std::vector<double>{1.0});
}

TEST(YamlSchema, FillsMembersOfEachType) {
  const Cart cart = read_cart(
      "name: a\ndrive: front\nseats: 4\nroof: open\nowners: [b, c]\nload: 0\nwheel: {radius: 0.5, offsets: 3}\n"
      "spare:\n  radius: 0.25\n  offsets: [1, 2]\n");
  EXPECT_EQ(cart.drive, Cart::Drive::kFront);
  EXPECT_EQ(cart.seats, 4);
  EXPECT_FALSE(cart.roofed);
  EXPECT_THAT(cart.owners, ::testing::ElementsAre("b", "c"));
  EXPECT_EQ(cart.load, 0.0);
  EXPECT_EQ(cart.wheel.radius, 0.5);
  EXPECT_EQ(cart.wheel.offsets, std::vector<double>{3.0});  // one number alone is a list of one
  EXPECT_EQ(cart.spare.value().line, 9);
  EXPECT_EQ(cart.spare->offsets, (std::vector<double>{1.0, 2.0}));
}

TEST(YamlSchema, WhatIsWrongIsNamedWithFileLineAndKey) {
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { read_cart("seats: 1\n"); }));
  for (const char* text :
       {"drve: 1\n", "drive: rea\n", "seats: 10\n", "seats: 1.5\n", "load: -1\n", "load: .nan\n", "owners: [b, [c]]\n",
        "spare: {radius: 0}\n", "wheel: {radius: 1, offsets: [1, x]}\n", "wheel: {radius: 1, offsets: []}\n"})
    EXPECT_SENTENCE(cart_refusal(text));
}

TEST(YamlSchema, WritesWhatDoesNotGoWithoutSaying) {
  const auto key = [](const char* value) {
    return SchemaKey<Cart>("k", {}, {}, [value](const Cart&) { return value; });
  };
  EXPECT_EQ(written(key("[a]"), Cart()), "k: [a]\n");
  EXPECT_EQ(written(key("\n  - a"), Cart()), "k:\n  - a\n");
  EXPECT_EQ(written(key(""), Cart()), "");
  EXPECT_EQ(written(SchemaKey<Cart>("k"), Cart()), "");
}

struct Lamp {
  double power = 5.0, warmth = 2.0;
  std::string label;
};

const FieldTable<Lamp>& lamp_fields() {
  static const FieldTable<Lamp> table = {
      field<Lamp>({.name = "power", .unit = "W", .range = {0.0, 60.0}}, &Lamp::power),
      field<Lamp>({.name = "warmth", .range = {0.0, 60.0}}, &Lamp::warmth, &Lamp::power),
      field<Lamp>({.name = "label"}, &Lamp::label)};
  return table;
}

Lamp read_lamp(const std::string& text) {
  Lamp lamp;
  const YamlSection section("l.yaml", parse_yaml(text, "l.yaml"), "lamp", key_names(lamp_fields()));
  read_fields(section, lamp_fields(), lamp);
  return lamp;
}

std::string lamp_refusal(const std::string& text) {
  return thrown_message<InputError>([&] { read_lamp(text); });
}

TEST(YamlFields, WhatIsNotNamedHasItsDefault) {
  const Lamp lamp = read_lamp("power: 1.5\nlabel: \"3\"\n");
  EXPECT_EQ(lamp.power, 1.5);
  EXPECT_EQ(lamp.warmth, 2.0);
  EXPECT_EQ(lamp.label, "3");
  EXPECT_EQ(read_lamp("power: 9\n").warmth, 9.0);  // a default rises to what bounds it
}

TEST(YamlFields, WhatIsWrongIsNamedWithFileLineAndKey) {
  for (const char* text :
       {"label: a\npower: 61\n", "power: [1]\n", "power:\n", "label: \"\"\n", "power: 7\nwarmth: 6\n", "powr: 7\n"})
    EXPECT_SENTENCE(lamp_refusal(text));
}

std::string flow_list(int entries) {
  std::string text = "key:\n  [";
  for (int i = 0; i < entries; ++i) text += "1,";
  return text + "]\n";
}

// Two bytes a value, and each takes some hundred bytes of memory: what is too much is refused before it is made.
TEST(Yaml, TooManyValuesAreRefusedWithTheirLine) {
  EXPECT_EQ(parse_yaml(flow_list(199997), "a.yaml")["key"].size(), 199997U);  // with the key, the mapping and the list
  EXPECT_SENTENCE(thrown_message<InputError>([] { parse_yaml(flow_list(199998), "a.yaml"); }));
}

TEST(Yaml, EmptyAndBrokenTextsAreToldApart) {
  EXPECT_TRUE(parse_yaml("", "a.yaml").IsNull());
  EXPECT_SENTENCE(thrown_message<InputError>([] { parse_yaml("a: [1, 2\n", "a.yaml"); }));
  EXPECT_SENTENCE(thrown_message<InputError>([] { parse_yaml("a: *nobody\n", "a.yaml"); }));
}

}  // namespace
}  // namespace duet
