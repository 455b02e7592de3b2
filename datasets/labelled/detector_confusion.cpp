#include "duet/datasets/labelled/detector_confusion.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <set>
#include <vector>

#include "duet/archives/csv.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/clips.h"
#include "duet/metrics/detector.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/formats/people_formats.h"
#include "duet/report/tables/text_table.h"

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
            table.rows.push_back({std::string(to_string(set)), excerpt(clip.clip), clip.label, who == 0 ? "A" : "B",
                                  std::string(to_string(task)), act ? "missed" : "accepted"});
      }
    }
  }
  for (const LabelledVerdicts& clip : verdicts)
    if (!clip.message.empty())
      table.rows.push_back({"-", excerpt(clip.clip), "-", "-", "-", "not read: " + clip.message});
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

namespace {

LabelledPeople people_of(const InteractionClip& clip, const std::string& label) {
  const auto at_rate = [](const HumanMotion& motion) {
    return motion.rate_hz == 50.0 ? human_agent(motion.joints) : human_agent(resample(motion, 50.0).joints);
  };
  return {at_rate(clip.a), at_rate(clip.b), label};
}

// People of any label: a clip needs a task to be made, which nothing here looks at.
LabelledPeople read_others(const PeopleFormat& format, const ClipPlace& place, const PeopleOptions& given) {
  PeopleOptions options = given;
  options.output_rate_hz = 50.0;
  if (format.clip != nullptr) {
    if (!options.task) options.task = Task::kHandshake;
    const SourceClip found = read_source_clip(format, place, options);
    return people_of(found.clip, given.task ? std::string(to_string(*given.task)) : "");
  }
  const RawPeople raw = format.read(place, options);
  const auto label = raw.source.find("label");
  const std::optional<Task> task = given.task ? given.task : raw.task;
  std::string own;
  if (task)
    own = to_string(*task);
  else if (label != raw.source.end())
    own = label->second;
  options.task = task.value_or(Task::kHandshake);
  return people_of(clip_of(raw, options).clip, own);
}

bool is_clip_of_duet(const std::string& path) {
  const std::vector<std::string> files = names_in(path);
  const auto first = std::find_if(files.begin(), files.end(), [](const std::string& n) { return n.ends_with(".npz"); });
  const std::string file = is_file(path) ? path : first == files.end() ? "" : fmt::format("{}/{}", path, *first);
  if (!file.ends_with(".npz")) return false;
  const std::vector<std::string> entries = zip_entry_names(file);
  return std::find(entries.begin(), entries.end(), "schema.npy") != entries.end();
}

std::vector<LabelledSource> sources_of(const LabelledClips& clips) {
  std::vector<LabelledSource> sources;
  require(!clips.paths.empty(), "expected the path of recordings, found none");
  if (clips.format.empty() && is_clip_of_duet(clips.paths.front())) {
    for (const std::string& file : find_motion_files(clips.paths))
      sources.push_back({stem_of(file), [file] {
                           return with_file_context(file, [&] {
                             const InteractionClip clip = load_clip(file);
                             return people_of(clip, std::string(to_string(clip.task)));
                           });
                         }});
    return sources;
  }
  const PeopleFormat& format = find_people_format(clips.paths, clips.format);
  for (const ClipPlace& place : format.find(clips.paths, clips.people))
    sources.push_back({place.id, [&format, place, &clips] { return read_others(format, place, clips.people); }});
  return sources;
}

void check_labels(const ClipLabels& labels, const std::vector<LabelledSource>& sources) {
  std::set<std::string> ids;
  for (const LabelledSource& source : sources) ids.insert(source.clip);
  const std::vector<std::string> known(ids.begin(), ids.end());
  for (const auto& [clip, label] : labels)
    if (!ids.contains(clip)) throw InputError(unknown_name_message("clip of the labels", clip, known));
}

// The task that a label means; nothing where it means none.
std::optional<Task> task_meant(const std::string& label) {
  for (const Task task : all_tasks())
    if (label == to_string(task)) return task;
  return task_of_label(label);
}

// One spelling a label: "Shake hands" and "handshake" are one line.
std::string plain_label(const std::string& label) {
  const std::optional<Task> task = task_meant(label);
  return task ? std::string(to_string(*task)) : excerpt(label);
}

LabelledPeople read_labelled(const LabelledSource& source, const ClipLabels& labels) {
  LabelledPeople people;
  const auto told = labels.find(source.clip);
  try {
    people = source.read();
  } catch (const InputError& error) {
    people.message = error.what();
    return people;
  }
  people.label = plain_label(told != labels.end() ? told->second : people.label);
  if (people.label.empty())
    throw InputError(fmt::format("'{}': neither the clip nor a file of labels says which act it is: give --labels FILE",
                                 excerpt(source.clip)));
  return people;
}

}  // namespace

std::vector<LabelledSource> labelled_sources(const LabelledClips& clips) {
  std::vector<LabelledSource> sources = sources_of(clips);
  check_labels(clips.labels, sources);
  std::erase_if(sources, [&](const LabelledSource& source) {
    const auto told = clips.labels.find(source.clip);
    return told != clips.labels.end() && told->second.empty();
  });
  return sources;
}

void for_each_labelled(const std::vector<LabelledSource>& sources, const LabelledClips& clips,
                       const std::function<void(int i, const LabelledPeople& people)>& take,
                       const std::function<void(int done, int of)>& finished) {
  std::mutex mutex;
  int done = 0;
  parallel_for_each(static_cast<int>(sources.size()), clips.threads, [&](int i) {
    take(i, read_labelled(sources[i], clips.labels));
    const std::lock_guard lock(mutex);
    ++done;
    if (finished) finished(done, static_cast<int>(sources.size()));
  });
}

namespace {

const std::vector<std::string> kLabelsHeader = {"clip", "label"};

}  // namespace

ClipLabels parse_clip_labels(std::string_view text, const std::string& name) {
  ClipLabels labels;
  CsvReader rows(text, name);
  require_header(rows, kLabelsHeader);
  while (rows.next()) {
    if (rows.blank()) continue;
    const auto fields = rows.fields();
    if (fields.size() != kLabelsHeader.size())
      rows.fail(fmt::format("expected 2 fields (clip,label), found '{}'",
                            excerpt(fmt::format("{}", fmt::join(fields, ",")))));
    if (fields[0].empty()) rows.fail("expected a clip's name in the first field, found none");
    if (!labels.emplace(fields[0], fields[1]).second)
      rows.fail(fmt::format("clip '{}' is there twice", excerpt(fields[0])));
  }
  return labels;
}

ClipLabels read_clip_labels(const std::string& path) { return parse_clip_labels(read_plain_text(path), path); }

}  // namespace duet
