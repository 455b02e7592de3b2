#include "duet/robots/yaml_schema.h"

#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

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

}  // namespace
}  // namespace duet
