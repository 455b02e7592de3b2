
#include "duet/core/require.h"
#include "duet/robots/yaml_schema.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

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

}  // namespace
}  // namespace duet
