#include "duet/robots/urdf.h"
#include "tests/robots/fixtures.h"

namespace duet {
namespace {

const std::string kTooDeep = "x.urdf:1: expected elements of at most 100 levels, found one that is deeper";

std::string refusal(const std::string& text) {
  return test::thrown_message<InputError>([&] { check_xml_nesting(text, "x.urdf"); });
}

std::string repeated(const std::string& text, int count) {
  std::string result;
  for (int i = 0; i < count; ++i) result += text;
  return result;
}

TEST(XmlNesting, AcceptsWhatIsAsDeepAsTheLimit) {
  check_xml_nesting(repeated("<a>", 100) + repeated("</a>", 100), "x.urdf");
  check_xml_nesting("<r>" + repeated("<a><b c='>'/><!-- <x> --></a>", 10'000) + "</r>", "x.urdf");
  check_xml_nesting(test::kSmallUrdf, "x.urdf");
}

TEST(XmlNesting, RefusesWhatNestsDeeper) {
  for (const int depth : {101, 200'000}) {
    EXPECT_EQ(refusal(repeated("<a>", depth)), kTooDeep);
    EXPECT_EQ(refusal(repeated("<a b=\"c\" >", depth)), kTooDeep);
    EXPECT_EQ(refusal("<r>" + repeated("<a>", depth) + repeated("</a>", depth) + "</r>"), kTooDeep);
  }
}

// Text that looks like an end and is none must not hide the depth.
TEST(XmlNesting, IsNotFooledByEndsInCommentsValuesAndText) {
  for (const char* level :
       {"<a><!-- </a> -->", "<a><![CDATA[</a>]]>", "<a b='/>'>", "<a b=\"</\">", "<a b='/' >", "<a b=\"'/>'\">",
        "<a><?xml x'y version='></a>'?>", "<a><?xml </a> ?>", "<a><!DOCTYPE </a> >", "<a><?b '/>' ?>"})
    EXPECT_NE(refusal(repeated(level, 101)), "(nothing was thrown)") << level;
  EXPECT_EQ(refusal(repeated("<a><!-- </a> -->", 101)), kTooDeep);
  EXPECT_EQ(refusal(repeated("<a b='/>'>", 101)), kTooDeep);
}

TEST(XmlNesting, RefusesMarkupWithoutItsEnd) {
  const std::string expected = "x.urdf:2: expected well-formed XML, found ";
  EXPECT_EQ(refusal("<a>\n<b"), expected + "a tag without its '>'");
  EXPECT_EQ(refusal("<a>\n<b c='>'"), expected + "a tag without its '>'");
  EXPECT_EQ(refusal("<a>\n<b c='<d>'/>"), expected + "a tag without its '>'");
  EXPECT_EQ(refusal("<a>\n<!-- b"), expected + "no end '-->'");
  EXPECT_EQ(refusal("<a>\n<![CDATA[ b"), expected + "no end ']]>'");
  EXPECT_SENTENCE(refusal("<a>\n<?b '>' ?>"));
  EXPECT_EQ(refusal("<a>\n<"), expected + "a tag without its '>'");
}

TEST(XmlNesting, ADeepUrdfIsRefusedInOneSentence) {
  EXPECT_EQ(test::thrown_message<InputError>([] { parse_urdf(repeated("<a>", 200'000), "x.urdf"); }), kTooDeep);
}

}  // namespace
}  // namespace duet
