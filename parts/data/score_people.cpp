// duet score --people: how many of the people in recordings whose act is known meet the rule `interaction`.
#include <fmt/format.h>

#include <memory>

#include "duet/core/require.h"
#include "duet/datasets/labelled/people_conditions.h"
#include "duet/experiment/work/run_work.h"
#include "duet/parts/data/part.h"
#include "duet/parts/data/people_arguments.h"

namespace duet::cli {
namespace {

struct PeopleScoring {
  bool asked = false;
  std::string labels;
  PeopleArguments people;
};

void score_people(const Session& session, const PeopleScoring& arguments, const GivenWords& given) {
  LabelledClips clips{
      .paths = given.words, .format = arguments.people.format, .people = people_options(arguments.people)};
  if (!arguments.labels.empty()) clips.labels = read_clip_labels(arguments.labels);
  clips.threads = given.threads;
  Progress progress(session.progress());
  const PeopleVerdicts verdicts = judge_people(clips, [&](int done, int of) {
    if (done == 1) progress.start("judging", of, "clips");
    progress.advance();
  });
  progress.finish();
  if (!verdicts.unread.empty())
    note(session, fmt::format("{} clips cannot be read and count nowhere; --each says why", verdicts.unread.size()));
  if (verdicts.still > 0) note(session, fmt::format("{} people stand still and count nowhere", verdicts.still));
  std::string text = markdown_table(people_conditions_table(verdicts));
  if (given.each) text += "\n" + markdown_table(people_failures_table(verdicts));
  print(session, text, people_conditions_json(verdicts));
}

}  // namespace

Instead add_people_scoring(CLI::App& command) {
  auto arguments = std::make_shared<PeopleScoring>();
  CLI::App& people =
      *command.add_option_group("people", "recordings of two people of any format, in the robot's place");
  people.add_flag("--people", arguments->asked,
                  "of recordings whose act is known: who meets which condition of the rule `interaction`");
  people.add_option("--labels", arguments->labels, "CSV \"clip,label\" (default: the recordings' own labels)");
  add_people_options(people, arguments->people);
  return [arguments](Session& session, const GivenWords& given) {
    require(arguments->asked || arguments->labels.empty(), "--labels is for --people");
    if (arguments->asked) score_people(session, *arguments, given);
    return arguments->asked;
  };
}

}  // namespace duet::cli
