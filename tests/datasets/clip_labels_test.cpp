#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "duet/datasets/labelled/detector_confusion.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

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
  EXPECT_EQ(refusal(""), "'labels.csv': expected the header 'clip,label', found nothing");
  EXPECT_EQ(refusal("clip;name\n"), "'labels.csv': line 1: expected the header 'clip,label', found 'clip,name'");
  EXPECT_EQ(refusal("clip,label\na\n"), "'labels.csv': line 2: expected 2 fields (clip,label), found 'a'");
  EXPECT_EQ(refusal("clip,label\na,b\nc,d,e\n"), "'labels.csv': line 3: expected 2 fields (clip,label), found 'c,d,e'");
  EXPECT_EQ(refusal("clip,label\n,hug\n"),
            "'labels.csv': line 2: expected a clip's name in the first field, found none");
  EXPECT_EQ(refusal("clip,label\na,hug\na,wave\n"), "'labels.csv': line 3: clip 'a' is there twice");
  EXPECT_THAT(test::thrown_message<InputError>([] { (void)read_clip_labels("/nowhere/labels.csv"); }),
              HasSubstr("/nowhere/labels.csv"));
}

}  // namespace
}  // namespace duet
