
#include "duet/core/require.h"
#include "duet/datasets/labelled/detector_confusion.h"
#include "tests/support.h"

namespace duet {
namespace {

std::string refusal(const std::string& text) {
  return test::thrown_message<InputError>([&] { (void)parse_clip_labels(text, "labels.csv"); });
}

TEST(ClipLabels, AreReadWithWhatPeopleTypeAroundThem) {
  EXPECT_EQ(parse_clip_labels("clip,label\nfirst,Shake hands\n\n second , hug \r\nthird,\n", "labels.csv"),
            (ClipLabels{{"first", "Shake hands"}, {"second", "hug"}, {"third", ""}}));
  EXPECT_EQ(parse_clip_labels("\xef\xbb\xbf"
                              "clip,label\r\na,b",
                              "labels.csv"),
            (ClipLabels{{"a", "b"}}));
  EXPECT_TRUE(parse_clip_labels("clip,label", "labels.csv").empty());
}

TEST(ClipLabels, RefusalsNameFileLineExpectedAndFound) {
  for (const char* text : {"", "clip;name\n", "clip,label\na\n", "clip,label\na,b\nc,d,e\n", "clip,label\n,hug\n",
                           "clip,label\na,hug\na,wave\n"})
    EXPECT_SENTENCE(refusal(text));
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { (void)read_clip_labels("/nowhere/labels.csv"); }));
}

}  // namespace
}  // namespace duet
