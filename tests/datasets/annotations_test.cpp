#include "duet/datasets/annotations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "duet/core/require.h"
#include "duet/datasets/labelled/detector_confusion.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::ElementsAre;

constexpr const char* kHeader = "clip,task,reactor,act_begin_s,act_end_s,note\n";

std::string refusal(const std::string& text) {
  try {
    (void)parse_annotations(text, "phases.csv");
  } catch (const InputError& error) {
    return error.what();
  }
  return "(taken)";
}

TEST(Annotations, WhatIsWrittenIsRead) {
  const InteractionClip clip = synthesize(Task::kHug, {.seed = 3});
  Annotation written = annotation_of(clip);
  written.note = "says \"hello\", twice";
  const Annotations read = parse_annotations(annotations_csv({written}), "phases.csv");
  ASSERT_EQ(read.size(), 1U);
  const Annotation& found = read.at(clip.id);
  EXPECT_EQ(found.task, clip.task);
  EXPECT_EQ(found.reactor, clip.reactor);
  EXPECT_NEAR(*found.act_begin, clip.phases.act_begin / 50.0, 0.005);
  EXPECT_NEAR(*found.act_end, clip.phases.act_end / 50.0, 0.005);
  EXPECT_EQ(found.note, written.note);
}

TEST(Annotations, APersonsTimesBecomeTheClipsPhases) {
  InteractionClip clip = synthesize(Task::kHug, {.seed = 3});
  annotate(clip, {.clip = clip.id, .task = Task::kHandshake, .reactor = Person::kA, .act_begin = 1.0, .act_end = 2.5});
  EXPECT_EQ(clip.phases.act_begin, 50);
  EXPECT_EQ(clip.phases.act_end, 125);
  EXPECT_EQ(clip.task, Task::kHandshake);
  EXPECT_EQ(clip.reactor, Person::kA);
  EXPECT_EQ(clip.source.at("phases"), "annotated");
}

TEST(Annotations, AnActMayBeginWithTheClip) {
  const Annotations read = parse_annotations(std::string(kHeader) + "a,hug,B,0,2,\n", "f");
  EXPECT_EQ(read.at("a").act_begin, 0.0);
}

TEST(Annotations, EmptyFieldsKeepWhatTheClipHas) {
  InteractionClip clip = synthesize(Task::kHug, {.seed = 3});
  const InteractionClip before = clip;
  annotate(clip, parse_annotations(std::string(kHeader) + "x,,,,,\n", "f").at("x"));
  EXPECT_EQ(clip.phases.act_begin, before.phases.act_begin);
  EXPECT_EQ(clip.task, before.task);
  EXPECT_EQ(clip.reactor, before.reactor);
}

TEST(Annotations, AnActAfterTheEndIsRefusedAndOneBeyondItIsCut) {
  InteractionClip clip = synthesize(Task::kHug, {.seed = 3});
  annotate(clip, {.clip = "x", .act_begin = 1.0, .act_end = 1e6});
  EXPECT_EQ(clip.phases.act_end, clip.frames());
  EXPECT_THROW(annotate(clip, {.clip = "x", .act_begin = 1e5, .act_end = 1e6}), InputError);
}

TEST(Annotations, ABadFileIsRefusedByLine) {
  EXPECT_SENTENCE(refusal(""));
  EXPECT_SENTENCE(refusal("clip,begin\n"));
  for (const std::string text :
       {"a,hug,B,1\n", "a,hugg,B,1,2,\n", "a,hug,C,1,2,\n", "a,hug,B,x,2,\n", "a,hug,B,-1,2,\n", "a,hug,B,2,2,\n",
        "a,hug,B,,2,\n", ",hug,B,1,2,\n", "a,,,,,\na,,,,,\n"})
    EXPECT_SENTENCE(refusal(std::string(kHeader) + text));
}

TEST(Annotations, WhatSpreadsheetsWriteIsTaken) {
  const std::string plain = std::string(kHeader) + "a,hug,B,1.5,2,\"fine, so far\"\n";
  std::string semicolons =
      "\xef\xbb\xbf"
      "clip;task;reactor;act_begin_s;act_end_s;note\r\na;hug;B;1,5;2;fine, so far\r\n;;;;;\r\n";
  std::string filled = "clip,task,reactor,act_begin_s,act_end_s,note,,\na,hug,B,1.5,2,\"fine, so far\",,\n,,,,,,,\n";
  std::string quoted =
      "\"clip\",\"task\",\"reactor\",\"act_begin_s\",\"act_end_s\",\"note\"\n\"a\",\"hug\",\"B\",\"1.5\",\"2\",\"fine, "
      "so far\"\n";
  for (const std::string& text : {plain, semicolons, filled, quoted}) {
    const Annotation read = parse_annotations(text, "f").at("a");
    EXPECT_EQ(read.task, Task::kHug) << text;
    EXPECT_EQ(read.act_begin, 1.5) << text;
    EXPECT_EQ(read.note, "fine, so far") << text;
  }
}

TEST(Annotations, LineEndsOfOtherSystemsAreTaken) {
  const Annotations read =
      parse_annotations("clip,task,reactor,act_begin_s,act_end_s,note\r\na,hug,B,1,2,fine\r\n", "f");
  EXPECT_EQ(read.at("a").note, "fine");
}

std::string refusal_of_labels(const std::string& text) {
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
    EXPECT_SENTENCE(refusal_of_labels(text));
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { (void)read_clip_labels("/nowhere/labels.csv"); }));
}

TEST(PhaseErrors, TheTableIsOfTheirSizes) {
  const std::vector<PhaseError> errors = {{.task = Task::kHug, .begin = -0.2, .end = 0.4, .overlap = 0.8},
                                          {.task = Task::kHug, .begin = 0.4, .end = 0.0, .overlap = 1.0},
                                          {.task = Task::kWave, .begin = 0.0, .end = -1.0, .overlap = 0.5}};
  const TextTable table = phase_error_table(errors);
  ASSERT_EQ(table.rows.size(), 3U);
  EXPECT_THAT(table.rows[0], ElementsAre("hug", "2", "0.30", "0.38", "0.20", "0.36", "0.90"));
  EXPECT_THAT(table.rows[1], ElementsAre("wave", "1", "0.00", "0.00", "1.00", "1.00", "0.50"));
  EXPECT_EQ(table.rows[2][1], "3");
}

TEST(PhaseErrors, ProposalsFindTheActThatSynthesisKnows) {
  const std::vector<PhaseError> errors = phase_errors(kPaperTasks, 3, 11, 2);
  ASSERT_EQ(errors.size(), 18U);
  for (const PhaseError& error : errors) {
    EXPECT_GT(error.overlap, 0.7) << to_string(error.task);
    EXPECT_LT(std::abs(error.begin), 1.5) << to_string(error.task);
    EXPECT_LT(std::abs(error.end), 1.5) << to_string(error.task);
  }
}

TEST(PhaseErrors, DoNotDependOnTheThreads) {
  const std::vector<PhaseError> one = phase_errors(kPaperTasks, 2, 3, 1), four = phase_errors(kPaperTasks, 2, 3, 4);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].begin, four[i].begin);
    EXPECT_EQ(one[i].end, four[i].end);
  }
}

}  // namespace
}  // namespace duet
