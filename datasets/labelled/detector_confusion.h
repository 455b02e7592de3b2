// How well detectors tell the acts apart on recordings whose label is known: sensitivity and specificity by set of
// thresholds, a table of label against detector, and the clips that were judged wrongly. People against people; each of
// the two is once the performer, and counts once.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "duet/metrics/detector.h"
#include "duet/motion/people/raw_people.h"
#include "duet/report/tables/text_table.h"
#include "duet/statistics/statistics.h"
#include "duet/tasks/rules/agent.h"

namespace duet {

// Labels of recordings in a file that a person or a data set's script writes: CSV with the header "clip,label". A label
// is a task's name, a data set's own word for one ("Shake hands"), or any other word: then it is none of the tasks.

using ClipLabels = std::map<std::string, std::string>;  // by the clip's id; "" leaves the clip out

// Throws InputError naming file and line: another header, a wrong number of fields, no clip, a clip twice.
ClipLabels parse_clip_labels(std::string_view text, const std::string& name);
ClipLabels read_clip_labels(const std::string& path);

// Recordings of two people whose label is known, read one at a time: clips of duet, or motions of others in any format
// of motion/people.

struct LabelledClips {
  std::vector<std::string> paths;  // clips of duet, or motions of others (people/formats/people_formats.h)
  std::string format = {};         // of people; empty: recognised
  PeopleOptions people = {};
  ClipLabels labels = {};  // before the files' own; one of a clip that is not there is refused
  int threads = 1;
};

// Both people of a clip, at 50 Hz.
struct LabelledPeople {
  Agent a, b;
  std::string label;         // a task's name, or what is no task
  std::string message = {};  // why the clip cannot be read; there are no people then
};

struct LabelledSource {
  std::string clip;
  std::function<LabelledPeople()> read;
};

// In the order of the files, without those whose label is empty. Throws InputError: no clip, a label of no clip.
std::vector<LabelledSource> labelled_sources(const LabelledClips& clips);

// Reads each and hands it over, from any thread and in any order. `finished` is called after each clip, one at a time.
// Throws InputError for a clip without a label anywhere (says how to give one).
void for_each_labelled(const std::vector<LabelledSource>& sources, const LabelledClips& clips,
                       const std::function<void(int i, const LabelledPeople& people)>& take,
                       const std::function<void(int done, int of)>& finished = {});

struct LabelledVerdicts {
  std::string clip, label;
  std::string message = {};  // why it was not read; no verdicts then
  // By set and task (the place in kThresholdSets, Task::index()): whether the detector accepts A, B as the performer.
  std::vector<std::vector<std::array<bool, 2>>> accepted = {};
};

// In the order of the files. Throws as labelled_sources and for_each_labelled.
std::vector<LabelledVerdicts> judge_labelled(const LabelledClips& clips,
                                             const std::function<void(int done, int of)>& finished = {});

// Rates of one detector. Counts are of performers: two a clip.
struct DetectorRates {
  ThresholdSet set = ThresholdSet::kPaper;
  Task task = Task::kHug;
  long hits = 0, acts = 0;       // of clips of the task: accepted, all
  long refused = 0, others = 0;  // of clips of other labels
};
std::vector<DetectorRates> detector_rates(const std::vector<LabelledVerdicts>& verdicts,
                                          const std::vector<ThresholdSet>& sets);

// One line a set and task.
TextTable rates_table(const std::vector<DetectorRates>& rates);
// One line a label, one column a detector: performers that are accepted, of how many.
TextTable confusion_table(const std::vector<LabelledVerdicts>& verdicts, ThresholdSet set);
// One line a wrong verdict: set, clip, label, performer, what was missed or accepted. Then the clips that were not
// read.
TextTable wrong_table(const std::vector<LabelledVerdicts>& verdicts, const std::vector<ThresholdSet>& sets);
nlohmann::json confusion_json(const std::vector<LabelledVerdicts>& verdicts, const std::vector<ThresholdSet>& sets,
                              bool list);

}  // namespace duet
