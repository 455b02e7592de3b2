#include "duet/datasets/people_clip.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "duet/core/machine.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/datasets/curation.h"
#include "duet/metrics/detector.h"

namespace duet {
namespace {

// In this order: on recorded people the strict hug takes few handshakes and the handshake many hugs, the high-five most
// handshakes, the wave some fly-kisses (rates of detectors on people: docs/detectors.md).
constexpr std::array kSearch = {Task::kHug,     Task::kHandshake, Task::kHighFive,
                                Task::kFlyKiss, Task::kWave,      Task::kBend};

bool is_seen(const InteractionClip& clip, ThresholdSet set) {
  const Agent a = human_agent(clip.a.joints), b = human_agent(clip.b.joints);
  const DetectorVersion version = DetectorVersion::kRobot;
  return detect(clip.task, a, b, version, set).success || detect(clip.task, b, a, version, set).success;
}

// The first task that is seen, by the rules of acts before strict thresholds before the printed ones. `clip(task)` is
// the recording as a clip of that task.
template <typename ClipOfTask>
SourceClip recognised(const std::string& name, ClipOfTask&& clip) {
  std::array<std::optional<SourceClip>, kSearch.size()> clips;  // each converted once
  for (const ThresholdSet set : {ThresholdSet::kAct, ThresholdSet::kStrict, ThresholdSet::kPaper}) {
    for (std::size_t i = 0; i < kSearch.size(); ++i) {
      const Task task = kSearch[i];
      if (!clips[i]) clips[i] = clip(task);
      if (!is_seen(clips[i]->clip, set)) continue;
      SourceClip found = std::move(*clips[i]);
      found.evidence.push_back(fmt::format("task: {} (its detector sees it on the people, {} thresholds; no label)",
                                           to_string(task), to_string(set)));
      found.clip.source["task"] = "detected";
      return found;
    }
  }
  throw InputError(fmt::format(
      "'{}': it has no label, and no task's detector sees its task on the people: expected --task NAME", name));
}

}  // namespace

std::string label_of(const PeopleFormat& format, const ClipPlace& place, const PeopleOptions& options) {
  if (format.clip != nullptr) return "";
  const RawPeople people = format.read(place, options);
  const auto label = people.source.find("label");
  return label == people.source.end() ? "" : label->second;
}

PeopleClip read_people_clip(const PeopleFormat& format, const ClipPlace& place, const PeopleOptions& options) {
  if (options.task || format.clip != nullptr) {
    if (options.task || format.states_task) return {.source = read_source_clip(format, place, options), .label = ""};
    return {.source = recognised(place.files.front(),
                                 [&](Task task) {
                                   PeopleOptions with_task = options;
                                   with_task.task = task;
                                   return read_source_clip(format, place, with_task);
                                 }),
            .label = ""};
  }
  const RawPeople people = format.read(place, options);
  const auto label = people.source.find("label");
  PeopleClip result{.source = std::nullopt, .label = label == people.source.end() ? "" : label->second};
  if (people.task) {
    result.source = clip_of(people, options);
  } else if (result.label.empty()) {
    result.source = recognised(people.name, [&](Task task) {
      PeopleOptions with_task = options;
      with_task.task = task;
      return clip_of(people, with_task);
    });
  }
  return result;
}

namespace {

constexpr std::size_t kSample = 32;
constexpr std::size_t kFewestRecordings = 5;
constexpr double kDigits = 100.0;  // what is usual is kept to 0.01

}  // namespace

std::map<std::string, int> count_labels(const PeopleFormat& format, const std::vector<ClipPlace>& places,
                                        const PeopleOptions& options, int threads) {
  std::vector<std::optional<std::string>> labels(places.size());
  parallel_for_each(static_cast<int>(places.size()), threads, [&](int i) {
    try {
      labels[i] = label_of(format, places[i], options);
    } catch (const InputError&) {  // its own entry says why
    }
  });
  std::map<std::string, int> counts;
  for (const std::optional<std::string>& label : labels)
    if (label) ++counts[*label];
  return counts;
}

double usual_bone_change(const PeopleFormat& format, const std::vector<ClipPlace>& places, const PeopleOptions& options,
                         int threads) {
  if (places.size() < kFewestRecordings) return 0.0;
  const std::size_t count = std::min(kSample, places.size());
  std::vector<std::optional<double>> changes(count);
  PeopleOptions any_task = options;
  any_task.as_is = true;
  if (!any_task.task) any_task.task = Task::kHandshake;  // bones are those of any task
  parallel_for_each(static_cast<int>(count), threads, [&](int i) {
    try {
      const ClipPlace& place = places[static_cast<std::size_t>(i) * places.size() / count];
      changes[i] = limb_bone_change(read_source_clip(format, place, any_task).clip);
    } catch (const InputError&) {  // its own entry says why
    }
  });
  std::vector<double> found;
  for (const std::optional<double>& change : changes)
    if (change) found.push_back(*change);
  return found.size() < kFewestRecordings ? 0.0 : std::round(kDigits * quantile(found, 0.5)) / kDigits;
}

}  // namespace duet
