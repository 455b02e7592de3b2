#include "duet/core/json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

std::string nested(const std::string& open, const std::string& close, int depth) {
  std::string text;
  for (int i = 0; i < depth; ++i) text += open;
  text += "1";
  for (int i = 0; i < depth; ++i) text += close;
  return text;
}

std::string refusal(const std::string& text) {
  return thrown_message<InputError>([&] { parse_json(text, "x.json"); });
}

TEST(ParseJson, ReadsWhatIsAsDeepAsTheLimit) {
  EXPECT_EQ(parse_json(nested("[", "]", kMostJsonDepth), "x.json").dump(), nested("[", "]", kMostJsonDepth));
  EXPECT_EQ(parse_json(R"({"a": [1, {"b": "[[[{{{"}]})", "x.json")["a"][1]["b"], "[[[{{{");
}

TEST(ParseJson, RefusesWhatNestsDeeper) {
  const std::string expected = "x.json: expected JSON of at most 64 levels, found one that is deeper";
  for (const int depth : {kMostJsonDepth + 1, 200'000}) {
    EXPECT_EQ(refusal(nested("[", "]", depth)), expected);
    EXPECT_EQ(refusal(nested("{\"a\":", "}", depth)), expected);
    EXPECT_EQ(refusal(nested("[{\"a\":", "}]", depth)), expected);
    EXPECT_EQ(refusal("{\"good\": 1, \"bad\": " + nested("[", "]", depth) + "}"), expected);
  }
  EXPECT_EQ(refusal(std::string(2'000'000, '[')), expected);  // never closed
}

TEST(ParseJson, RefusesAKeyThatIsThereTwice) {
  const auto twice = [](const std::string& key) {
    return "x.json: expected each key of an object once, found '" + key + "' twice";
  };
  EXPECT_EQ(refusal(R"({"a": 1, "b": 2, "a": 1})"), twice("a"));
  EXPECT_EQ(refusal(R"({"a": [{"b": {}}, {"b": {"c": 1, "d": [], "\u0063": 2}}]})"), twice("c"));
  EXPECT_EQ(refusal(R"([{"a": {"a": {"a": 1}, "b": 1, "b": 2}}])"), twice("b"));
  EXPECT_EQ(parse_json(R"({"a": {"a": {"a": 1}}, "b": [{"a": 1}, {"a": 2}]})", "x.json").size(), 2U);
}

TEST(ParseJson, AFaultIsOneSentenceThatBeginsWithTheDocument) {
  for (const char* text : {"{", "{\"a\": 1e999}", "\"\xff\""}) EXPECT_SENTENCE(refusal(text));
}

TEST(Dumped, WritesBytesThatAreNoUtf8AsAReplacementCharacterAndKeepsOrder) {
  EXPECT_EQ(dumped(nlohmann::json("bad\xff name")), "\"bad\ufffd name\"");
  EXPECT_EQ(dumped(nlohmann::json{{"b", 1}, {"a", 2}}), R"({"a":2,"b":1})");
  EXPECT_EQ(dumped(nlohmann::ordered_json{{"b", 1}, {"a", 2}}), R"({"b":1,"a":2})");
}

TEST(ParseJson, AFaultDoesNotRepeatTheDocument) {
  EXPECT_LT(refusal("\"" + std::string(400'000, 'x')).size(), 300u);
  EXPECT_LT(refusal(std::string(400'000, '9')).size(), 300u);
  EXPECT_EQ(refusal("\"\x1b[31m\"").find('\x1b'), std::string::npos);
}

}  // namespace
}  // namespace duet
