// People in the robot's place: how many of the people in recordings whose act is known meet the conditions of the rule
// `interaction` that need no physics. Each of the two is judged once as if he were the robot and the other a ghost; the
// whole recording is the act's window, and nobody stood in his place before him. Somebody who stands still throughout
// is no performer. Two people of one recording are not independent: intervals are a little too narrow.
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/core/task.h"
#include "duet/datasets/labelled/detector_confusion.h"
#include "duet/report/tables/text_table.h"
#include "duet/tasks/rules/agent.h"

namespace duet {

// One performer under the rule of one task. Conditions: act, alone, touch, body, reply.
struct PersonCheck {
  std::string clip, label;
  char person = 'A';  // or B
  std::map<Task, DetectorResult> by_task;
};

struct PeopleVerdicts {
  std::vector<PersonCheck> people;            // in the order of the files
  std::map<std::string, std::string> unread;  // by clip: why
  long still = 0;                             // people who stand still
};

// Throws as labelled_sources and for_each_labelled.
PeopleVerdicts judge_people(const LabelledClips& clips, const std::function<void(int done, int of)>& finished = {});

// One line a task: of those who do it the share that meets each condition and all of them, of all others the share that
// is refused; Wilson intervals of 95 %.
TextTable people_conditions_table(const PeopleVerdicts& verdicts);
// One line for each who does a task and fails, with what failed and what was measured, and for each whose verdict is
// another task's success.
TextTable people_failures_table(const PeopleVerdicts& verdicts);
nlohmann::json people_conditions_json(const PeopleVerdicts& verdicts);

}  // namespace duet
