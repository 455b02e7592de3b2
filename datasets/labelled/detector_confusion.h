// How well detectors tell the acts apart on recordings whose label is known: sensitivity and specificity by set of
// thresholds, a table of label against detector, and the clips that were judged wrongly. People against people; each of
// the two is once the performer, and counts once.
#pragma once

#include <array>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/datasets/labelled/labelled_people.h"
#include "duet/metrics/detector.h"
#include "duet/report/tables/text_table.h"
#include "duet/statistics/statistics.h"

namespace duet {

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
