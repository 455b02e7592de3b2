#include "duet/datasets/people_clip.h"

#include <fmt/format.h>

#include <array>
#include <optional>
#include <utility>

#include "duet/core/require.h"
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

}  // namespace duet
