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

}  // namespace
}  // namespace duet
