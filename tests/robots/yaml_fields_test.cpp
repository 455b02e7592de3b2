#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "duet/robots/yaml_section.h"
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
  const YamlSection section("l.yaml", parse_yaml(text, "l.yaml"), "lamp", field_keys(lamp_fields()));
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
  EXPECT_EQ(lamp_refusal("label: a\npower: 61\n"),
            "l.yaml:2: lamp: power: expected a number from 0, at most 60 W, found 61");
  EXPECT_EQ(lamp_refusal("power: [1]\n"),
            "l.yaml:1: lamp: power: expected a number from 0, at most 60 W, found a list of 1");
  EXPECT_EQ(lamp_refusal("power:\n"), "l.yaml:1: lamp: power: expected a number from 0, at most 60 W, found nothing");
  EXPECT_EQ(lamp_refusal("label: \"\"\n"), "l.yaml:1: lamp: label: expected a text, found ''");
  EXPECT_EQ(lamp_refusal("power: 7\nwarmth: 6\n"),
            "l.yaml:2: lamp: warmth: expected a number from 7, at most 60, found 6");
  EXPECT_EQ(lamp_refusal("powr: 7\n"),
            "l.yaml:1: lamp: unknown key 'powr': did you mean 'power'? Known: power, warmth, label");
}

}  // namespace
}  // namespace duet
