#include "duet/datasets/dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/machine.h"
#include "duet/core/names.h"
#include "duet/core/share.h"
#include "duet/datasets/curation.h"
#include "duet/datasets/dataset_card.h"
#include "duet/datasets/entry.h"
#include "duet/datasets/people_clip.h"
#include "duet/metrics/detector.h"
#include "duet/metrics/locomotion.h"
#include "duet/metrics/retargeting.h"
#include "duet/motion/people/made_up.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/formats/people_formats.h"
#include "duet/retarget/solver/pair.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

using nlohmann::json;

// Everything that decides what a clip becomes, but its own files and annotation.
json settings_of(const DatasetPlan& plan, const PeopleFormat& format) {
  const PeopleOptions& people = plan.people;
  json settings = {
      {"schema", "duet.dataset"}, {"schema_version", 1}, {"duet", duet_version()}, {"format", format.name}};
  const auto or_null = [](const auto& value) { return value ? json(*value) : json(); };
  settings["people"] = {{"metres_per_unit", or_null(people.metres_per_unit)},
                        {"up", people.up ? json(static_cast<int>(*people.up)) : json()},
                        {"rate_hz", or_null(people.rate_hz)},
                        {"mirrored", or_null(people.mirrored)},
                        {"level", or_null(people.level)},
                        {"floor", or_null(people.floor)},
                        {"drop_t_pose", or_null(people.drop_t_pose)},
                        {"as_is", people.as_is},
                        {"skeleton", people.skeleton},
                        {"body_model", people.body_model.empty() ? "" : sha256_file(people.body_model)},
                        {"object", people.object.empty() ? "" : sha256_file(people.object)},
                        {"align", static_cast<int>(people.align)},
                        {"task", people.task ? json(to_string(*people.task)) : json()},
                        {"reactor", people.reactor ? json(*people.reactor == Person::kA ? "A" : "B") : json()}};
  if (people.fill_gaps) settings["people"]["fill_gaps_s"] = *people.fill_gaps;
  if (people.still_partner) settings["people"]["still_partner"] = true;
  json& curation = settings["curation"] = json::object();
  for (const Gate gate : plan.curation.gates) curation["gates"].push_back(to_string(gate));
  for (const auto& [name, limit] : plan.curation.limits) curation["limits"][name] = limit;
  for (const std::string& option : pair_option_names())
    if (option != "kernel") settings["pair"][option] = pair_option(plan.pair, option);
  for (const DatasetRobot& robot : plan.robots) settings["robots"][robot.name] = robot.model->digest;
  settings["pad_s"] = {plan.pad_before, plan.pad_after};
  settings["keep_rejected"] = plan.keep_rejected;
  return settings;
}

// A name that stands in files: what is neither letter, digit nor one of _ . + - becomes '-'.
std::string plain_id(const std::string& id) {
  std::string stem = id;
  for (char& c : stem)
    if (!is_plain_letter(c)) c = '-';
  return stem.empty() || stem.front() == '.' ? "clip" + stem : stem;
}

std::vector<ClipPlace> named_places(std::vector<ClipPlace> places) {
  std::set<std::string> names;
  for (ClipPlace& place : places) {
    place.id = plain_id(place.id);
    if (!names.insert(place.id).second)
      throw InputError(fmt::format("two clips are named '{}' (the second in '{}'): give them to two data sets",
                                   place.id, place.files.empty() ? "" : place.files.front()));
  }
  return places;
}

// Removes the maker's folders from the texts of a data set: paths begin below the inputs.
class InputFolders {
 public:
  explicit InputFolders(const std::vector<std::string>& inputs) {
    for (const std::string& input : inputs) {
      std::filesystem::path folder(input);
      if (!std::filesystem::is_directory(folder)) folder = folder.parent_path();
      if (!folder.empty()) prefixes_.push_back((folder / "").string());
    }
  }

  void strip(std::string& text) const {
    for (const std::string& prefix : prefixes_)
      for (std::size_t at = text.find(prefix); at != std::string::npos; at = text.find(prefix, at))
        text.erase(at, prefix.size());
  }
  void strip(std::vector<std::string>& texts) const {
    for (std::string& text : texts) strip(text);
  }
  void strip(std::map<std::string, std::string>& texts) const {
    for (auto& [name, text] : texts) strip(text);
  }

 private:
  std::vector<std::string> prefixes_;
};

class StageClock {
 public:
  explicit StageClock(std::map<std::string, double>& seconds) : seconds_(seconds) {}
  // Ends the stage that runs and begins the next.
  void stage(const std::string& name) {
    const auto now = std::chrono::steady_clock::now();
    if (!name_.empty()) seconds_[name_] += std::chrono::duration<double>(now - begin_).count();
    name_ = name;
    begin_ = now;
  }

 private:
  std::map<std::string, double>& seconds_;
  std::string name_;
  std::chrono::steady_clock::time_point begin_;
};

std::string key_of(const std::string& settings, const std::vector<NamedDigest>& files, const ClipPlace& place,
                   const Annotations& annotations, const SourceFacts& source) {
  Sha256 digest;
  digest.update(settings);
  digest.update(fmt::format("{} {}\n", source.bone_change, source.is_mixed()));
  for (const NamedDigest& file : files) digest.update(file.file + "\n" + file.sha256 + "\n");
  digest.update(place.entry);
  const auto annotation = annotations.find(place.id);
  if (annotation != annotations.end()) digest.update(annotations_csv({annotation->second}));
  return digest.hex();
}

// The 18 metrics, how it stands, what it does with an object that is carried, and whether the task's detector sees it.
std::map<std::string, double> figures_of(const PairedMotion& paired, const RobotModel& robot) {
  std::map<std::string, double> figures = retargeting_metrics(paired, robot);
  figures.merge(grounding_metrics(paired, robot));
  figures.merge(object_metrics(paired, robot));
  figures["robot_detected"] =
      detect(paired.task, human_agent(paired.partner.joints), robot_agent(robot, paired.robot), DetectorVersion::kRobot)
          .success;
  return figures;
}

// The work of one thread on one clip.
class ClipWork {
 public:
  ClipWork(const DatasetPlan& plan, const PeopleFormat& format, const SourceFacts& source, const std::string& folder,
           const ClipPlace& place, std::map<std::string, double>& seconds)
      : plan_(plan),
        format_(format),
        source_(source),
        folder_(folder),
        place_(place),
        inputs_(plan.inputs),
        clock_(seconds) {}

  DatasetEntry run(DatasetEntry entry) {
    entry.format = format_.name;
    entry.licence = format_.licence;
    try {
      with_file_context(place_.files.front(), [&] { make(entry); });
    } catch (const StorageError&) {
      throw;
    } catch (const InputError& error) {
      entry.status = ClipStatus::kFailed;
      entry.reasons = {error.what()};
      inputs_.strip(entry.reasons);
    }
    clock_.stage("");
    return entry;
  }

 private:
  void make(DatasetEntry& entry) {
    clock_.stage("read");
    PeopleOptions options = plan_.people;
    const auto annotation = plan_.annotations.find(place_.id);
    if (annotation != plan_.annotations.end() && annotation->second.task) options.task = annotation->second.task;
    const bool told_for_all = plan_.people.task && !(annotation != plan_.annotations.end() && annotation->second.task);
    if (told_for_all && source_.is_mixed() && is_other(entry)) return;
    PeopleClip read = read_people_clip(format_, place_, options);
    if (entry.label.empty()) entry.label = read.label;
    if (!read.source) {
      entry.status = ClipStatus::kOther;
      entry.reasons = {
          fmt::format("its label '{}' is none of duet's tasks (annotations.csv can give it one)", read.label)};
      return;
    }
    InteractionClip& clip = read.source->clip;
    clip.id = place_.id;
    if (const auto label = clip.source.find("label"); entry.label.empty() && label != clip.source.end())
      entry.label = label->second;
    if (annotation != plan_.annotations.end()) annotate(clip, annotation->second);
    entry.evidence = std::move(read.source->evidence);
    inputs_.strip(entry.evidence);
    inputs_.strip(clip.source);
    describe(entry, clip);
    clock_.stage("curate");
    const CurationResult verdict = judge(entry, clip);
    if (!verdict.passed()) {
      clock_.stage("write");
      keep(entry, rejected_file(place_.id),
           clip_picture_svg(clip, {verdict.worst_frame()}, place_.id + ": " + verdict.reasons().front()));
      if (!plan_.keep_rejected) return;
    }
    pad(entry, clip);
    clock_.stage("write");
    keep(entry, people_file(place_.id), clip_bytes(clip, ZipMethod::kStored));
    for (const DatasetRobot& robot : plan_.robots) retarget_for(robot, clip, entry);
  }

  // Whether, among recordings of several labels, this one's is another than the task that was told for all.
  bool is_other(DatasetEntry& entry) const {
    entry.label = label_of(format_, place_, plan_.people);
    if (entry.label.empty() || task_of_label(entry.label) == plan_.people.task) return false;
    entry.status = ClipStatus::kOther;
    entry.reasons = {
        fmt::format("its label '{}' is not --task {}, and the recordings have several labels "
                    "(annotations.csv can give it a task)",
                    entry.label, to_string(*plan_.people.task))};
    return true;
  }

  static void describe(DatasetEntry& entry, const InteractionClip& clip) {
    entry.provenance = clip.source;
    entry.made_up = made_up_of(clip.source);
    std::erase_if(entry.provenance, [](const auto& item) { return item.first.starts_with(kMadeUpKey); });
    entry.task = to_string(clip.task);
    entry.reactor = clip.reactor == Person::kA ? "A" : "B";
    entry.frames = clip.frames();
    entry.act_begin = clip.phases.act_begin / clip.rate_hz();
    entry.act_end = clip.phases.act_end / clip.rate_hz();
    entry.statistics = clip_statistics(clip);
  }

  CurationResult judge(DatasetEntry& entry, const InteractionClip& clip) const {
    CurationOptions options = plan_.curation;
    options.source_bone_change = source_.bone_change;
    CurationResult verdict = curate(clip, options);
    for (const CriterionFinding& finding : verdict.findings)
      entry.criteria[std::string(finding.criterion->name)] = finding.value;
    entry.status = verdict.passed() ? ClipStatus::kKept : ClipStatus::kRejected;
    for (const Gate gate : verdict.refused_by()) entry.gates.emplace_back(to_string(gate));
    entry.reasons = verdict.reasons();
    return verdict;
  }

  void pad(DatasetEntry& entry, InteractionClip& clip) const {
    if (plan_.pad_before == 0.0 && plan_.pad_after == 0.0) return;
    clip = padded(clip, plan_.pad_before, plan_.pad_after);
    clip.source["padded_s"] = fmt::format("{:g} before, {:g} after", plan_.pad_before, plan_.pad_after);
    describe(entry, clip);
  }

  void retarget_for(const DatasetRobot& robot, const InteractionClip& clip, DatasetEntry& entry) {
    clock_.stage("retarget");
    const PairedMotion paired = retarget(clip, *robot.model, plan_.pair);
    clock_.stage("score");
    entry.metrics[robot.name] = figures_of(paired, *robot.model);
    clock_.stage("write");
    keep(entry, robot_file(robot.name, place_.id), paired_motion_bytes(paired, ZipMethod::kStored));
  }

  void keep(DatasetEntry& entry, const std::string& file, const std::string& bytes) const {
    write_file(join_without_links(folder_, file), bytes, Durability::kUnsynced);
    entry.outputs.push_back({.file = file, .sha256 = sha256_hex(bytes)});
  }

  const DatasetPlan& plan_;
  const PeopleFormat& format_;
  const SourceFacts& source_;
  const std::string& folder_;
  const ClipPlace& place_;
  InputFolders inputs_;
  StageClock clock_;
};

void count(DatasetSummary& summary, const DatasetEntry& entry, bool from_before) {
  int* const counters[] = {&summary.kept, &summary.rejected, &summary.other, &summary.failed};
  ++*counters[static_cast<int>(entry.status)];
  summary.from_before += from_before;
}

// Digests of files that hold many clips are taken once: Inter-X has 9,000 clips in one file of gigabytes.
class SourceDigests {
 public:
  std::string of(const ClipPlace& place, const std::string& file) {
    if (place.entry.empty()) return sha256_file(file);
    const std::lock_guard hold(mutex_);  // who waits needs the same file, or another such
    std::string& digest = containers_[file];
    if (digest.empty()) digest = sha256_file(file);
    return digest;
  }

 private:
  std::mutex mutex_;
  std::map<std::string, std::string> containers_;
};

// The state that all threads share.
class DatasetWork {
 public:
  DatasetWork(const DatasetPlan& plan, const std::string& folder, const DatasetEvents& events)
      : plan_(plan),
        format_(find_people_format(plan.inputs, plan.format)),
        settings_(settings_of(plan, format_)),
        places_(named_places(format_.find(plan.inputs, plan.people))),
        folder_(folder, settings_),
        events_(events) {
    summary_.format = format_.name;
    summary_.clips = static_cast<int>(places_.size());
    if (events_.found) events_.found(summary_.clips);
    check_annotations();
    find_facts();
  }

  DatasetSummary run() {
    parallel_for_each(static_cast<int>(places_.size()), plan_.threads, [&](int i) {
      if (stopped()) return;
      make(places_[static_cast<std::size_t>(i)]);
    });
    write_derived_files(folder_.path(), folder_.entries());
    return summary_;
  }

 private:
  void check_annotations() const {
    std::set<std::string> names;
    for (const ClipPlace& place : places_) names.insert(place.id);
    for (const auto& [clip, annotation] : plan_.annotations)
      if (!names.contains(clip))
        throw InputError(
            fmt::format("the annotations name clip '{}', which is not among the {} clips", clip, places_.size()));
  }

  void find_facts() {
    if (plan_.people.task) source_.labels = count_labels(format_, places_, plan_.people, plan_.threads);
    const bool judges_bones = std::ranges::count(plan_.curation.gates, Gate::kMotionFidelity) > 0 &&
                              !plan_.curation.limits.contains("bone_change");
    if (judges_bones) source_.bone_change = usual_bone_change(format_, places_, plan_.people, plan_.threads);
  }

  bool stopped() {
    const std::lock_guard hold(mutex_);
    summary_.stopped = summary_.stopped || (events_.stop && events_.stop());
    return summary_.stopped;
  }

  void make(const ClipPlace& place) {
    std::map<std::string, double> seconds;
    DatasetEntry entry{.clip = place.id};
    try {
      for (const std::string& file : place.files)
        entry.sources.push_back(
            {.file = std::filesystem::path(file).filename().string(), .sha256 = digests_.of(place, file)});
    } catch (const InputError&) {
      entry.sources.clear();  // the reader says what is wrong with it
    }
    entry.key = key_of(dumped(settings_), entry.sources, place, plan_.annotations, source_);
    if (const std::optional<DatasetEntry> before = folder_.find(place.id, entry.key))
      return finish(*before, true, seconds);
    entry = ClipWork(plan_, format_, source_, folder_.path(), place, seconds).run(std::move(entry));
    folder_.append(entry);
    finish(entry, false, seconds);
  }

  void finish(const DatasetEntry& entry, bool from_before, const std::map<std::string, double>& seconds) {
    const std::lock_guard hold(mutex_);
    count(summary_, entry, from_before);
    for (const auto& [stage, time] : seconds) summary_.seconds[stage] += time;
    if (events_.finished) events_.finished(entry, from_before);
  }

  const DatasetPlan& plan_;
  const PeopleFormat& format_;
  json settings_;
  std::vector<ClipPlace> places_;
  SourceFacts source_;
  DatasetFolder folder_;
  const DatasetEvents& events_;
  SourceDigests digests_;
  std::mutex mutex_;
  DatasetSummary summary_;
};

}  // namespace

DatasetSummary make_dataset(const DatasetPlan& plan, const std::string& folder, const DatasetEvents& events) {
  return DatasetWork(plan, folder, events).run();
}

}  // namespace duet
