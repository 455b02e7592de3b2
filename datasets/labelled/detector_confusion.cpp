#include "duet/datasets/labelled/detector_confusion.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "duet/core/text.h"
#include "duet/report/tables/cells.h"

namespace duet {
namespace {

LabelledVerdicts judge(const std::string& clip, const LabelledPeople& people) {
  LabelledVerdicts verdicts{.clip = clip, .label = people.label, .message = people.message};
  if (!people.message.empty()) return verdicts;
  for (const ThresholdSet set : kThresholdSets) {
    auto& of_set = verdicts.accepted.emplace_back(all_tasks().size());
    for (const Task task : all_tasks()) {
      const auto accepts = [&](const Agent& performer, const Agent& partner) {
        return detect(task, partner, performer, DetectorVersion::kRobot, set).success;
      };
      of_set[task.index()] = {accepts(people.a, people.b), accepts(people.b, people.a)};
    }
  }
  return verdicts;
}

const std::array<bool, 2>& accepted(const LabelledVerdicts& verdicts, ThresholdSet set, Task task) {
  return verdicts.accepted[static_cast<std::size_t>(set)][task.index()];
}

void add_rate(std::vector<std::string>& row, long hits, long all) {
  if (all == 0) {
    row.insert(row.end(), {"-", "-", "-"});
    return;
  }
  const Interval interval = wilson(hits, all);
  row.insert(row.end(), {fmt::format("{}/{}", hits, all), percent(static_cast<double>(hits) / all),
                         fmt::format("[{}, {}]", percent(interval.low), percent(interval.high))});
}

nlohmann::json rate_json(long hits, long all) {
  if (all == 0) return nullptr;
  const Interval interval = wilson(hits, all);
  return {{"hits", hits},
          {"of", all},
          {"share", static_cast<double>(hits) / all},
          {"low", interval.low},
          {"high", interval.high}};
}

// Tasks first, in their order, then other labels by name.
std::vector<std::string> labels_of(const std::vector<LabelledVerdicts>& verdicts) {
  std::set<std::string> found;
  for (const LabelledVerdicts& clip : verdicts)
    if (clip.message.empty()) found.insert(clip.label);
  std::vector<std::string> labels;
  labels.reserve(found.size());
  for (const Task task : all_tasks())
    if (found.erase(std::string(to_string(task))) > 0) labels.emplace_back(to_string(task));
  labels.insert(labels.end(), found.begin(), found.end());
  return labels;
}

// Counts over all clips of a label: accepted performers by task, and how many performers there are.
struct LabelCounts {
  std::vector<long> accepted;
  long performers = 0;
};
LabelCounts count_label(const std::vector<LabelledVerdicts>& verdicts, const std::string& label, ThresholdSet set) {
  LabelCounts counts{std::vector<long>(all_tasks().size(), 0)};
  for (const LabelledVerdicts& clip : verdicts) {
    if (!clip.message.empty() || clip.label != label) continue;
    counts.performers += 2;
    for (const Task task : all_tasks())
      for (const bool one : accepted(clip, set, task)) counts.accepted[task.index()] += one ? 1 : 0;
  }
  return counts;
}

}  // namespace

std::vector<LabelledVerdicts> judge_labelled(const LabelledClips& clips,
                                             const std::function<void(int done, int of)>& finished) {
  const std::vector<LabelledSource> sources = labelled_sources(clips);
  std::vector<LabelledVerdicts> verdicts(sources.size());
  for_each_labelled(
      sources, clips, [&](int i, const LabelledPeople& people) { verdicts[i] = judge(sources[i].clip, people); },
      finished);
  return verdicts;
}

std::vector<DetectorRates> detector_rates(const std::vector<LabelledVerdicts>& verdicts,
                                          const std::vector<ThresholdSet>& sets) {
  std::vector<DetectorRates> rates;
  for (const ThresholdSet set : sets) {
    for (const Task task : all_tasks()) {
      DetectorRates rate{.set = set, .task = task};
      for (const LabelledVerdicts& clip : verdicts) {
        if (!clip.message.empty()) continue;
        const bool act = clip.label == to_string(task);
        for (const bool accepts : accepted(clip, set, task)) {
          (act ? rate.acts : rate.others) += 1;
          if (accepts == act) (act ? rate.hits : rate.refused) += 1;
        }
      }
      rates.push_back(rate);
    }
  }
  return rates;
}

TextTable rates_table(const std::vector<DetectorRates>& rates) {
  TextTable table{.header = {"set", "detector", "accepted of the act", "sensitivity %", "95 %", "refused of others",
                             "specificity %", "95 %"},
                  .rows = {},
                  .label_columns = 2};
  for (const DetectorRates& rate : rates) {
    std::vector<std::string> row = {std::string(to_string(rate.set)), std::string(to_string(rate.task))};
    add_rate(row, rate.hits, rate.acts);
    add_rate(row, rate.refused, rate.others);
    table.rows.push_back(std::move(row));
  }
  return table;
}

TextTable confusion_table(const std::vector<LabelledVerdicts>& verdicts, ThresholdSet set) {
  TextTable table{.header = {fmt::format("{}: label", to_string(set)), "performers"}, .rows = {}, .label_columns = 1};
  for (const Task task : all_tasks()) table.header.emplace_back(to_string(task));
  for (const std::string& label : labels_of(verdicts)) {
    const LabelCounts counts = count_label(verdicts, label, set);
    std::vector<std::string> row = {label, std::to_string(counts.performers)};
    for (const long accepts : counts.accepted) row.push_back(std::to_string(accepts));
    table.rows.push_back(std::move(row));
  }
  return table;
}

TextTable wrong_table(const std::vector<LabelledVerdicts>& verdicts, const std::vector<ThresholdSet>& sets) {
  TextTable table{.header = {"set", "clip", "label", "performer", "detector", "wrong"}, .rows = {}, .label_columns = 6};
  for (const ThresholdSet set : sets) {
    for (const LabelledVerdicts& clip : verdicts) {
      if (!clip.message.empty()) continue;
      for (const Task task : all_tasks()) {
        const bool act = clip.label == to_string(task);
        for (const int who : {0, 1})
          if (accepted(clip, set, task)[who] != act)
            table.rows.push_back({std::string(to_string(set)), shown(clip.clip), clip.label, who == 0 ? "A" : "B",
                                  std::string(to_string(task)), act ? "missed" : "accepted"});
      }
    }
  }
  for (const LabelledVerdicts& clip : verdicts)
    if (!clip.message.empty())
      table.rows.push_back({"-", shown(clip.clip), "-", "-", "-", "not read: " + clip.message});
  return table;
}

nlohmann::json confusion_json(const std::vector<LabelledVerdicts>& verdicts, const std::vector<ThresholdSet>& sets,
                              bool list) {
  nlohmann::json json = {{"clips", verdicts.size()}, {"unread", nlohmann::json::array()}};
  for (const LabelledVerdicts& clip : verdicts)
    if (!clip.message.empty()) json["unread"].push_back({{"clip", clip.clip}, {"message", clip.message}});
  for (const DetectorRates& rate : detector_rates(verdicts, sets))
    json["sets"][std::string(to_string(rate.set))]["detectors"][std::string(to_string(rate.task))] = {
        {"sensitivity", rate_json(rate.hits, rate.acts)}, {"specificity", rate_json(rate.refused, rate.others)}};
  for (const ThresholdSet set : sets) {
    nlohmann::json& of_set = json["sets"][std::string(to_string(set))];
    for (const std::string& label : labels_of(verdicts)) {
      const LabelCounts counts = count_label(verdicts, label, set);
      nlohmann::json& row = of_set["confusion"][label];
      row["performers"] = counts.performers;
      for (const Task task : all_tasks()) row["accepted"][std::string(to_string(task))] = counts.accepted[task.index()];
    }
  }
  if (!list) return json;
  json["wrong"] = nlohmann::json::array();
  for (const std::vector<std::string>& row : wrong_table(verdicts, sets).rows)
    if (row[0] != "-")
      json["wrong"].push_back({{"set", row[0]},
                               {"clip", row[1]},
                               {"label", row[2]},
                               {"performer", row[3]},
                               {"detector", row[4]},
                               {"wrong", row[5]}});
  return json;
}

}  // namespace duet
