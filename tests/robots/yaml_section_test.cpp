#include "duet/robots/yaml_section.h"

#include "duet/core/require.h"
#include "duet/robots/yaml_section.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

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

TEST(InRange, RefusesWhatIsBelowAndWhatIsAboveAndAnEndThatIsLeftOut) {
  const auto read = [](const char* text, bool with_low) {
    return in_range(YamlSection("a.yaml", parse_yaml(text, "a.yaml"), "range", {"x"}), "x", 7.0, {1.0, 2.0, with_low});
  };
  EXPECT_EQ(read("x: 1.5", true), 1.5);
  EXPECT_EQ(read("x: 1", true), 1.0);
  EXPECT_EQ(read("x: 2", false), 2.0);
  EXPECT_SENTENCE(thrown_message<InputError>([&] { read("x: 0.5", true); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { read("\nx: 2.5", true); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { read("x: 1", false); }));
}

}  // namespace
}  // namespace duet
