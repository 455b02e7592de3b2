#include "duet/datasets/labelled/labelled_people.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <set>

#include "duet/archives/zip/zip.h"
#include "duet/core/names.h"
#include "duet/core/naming_file.h"
#include "duet/core/parallel.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/experiment/plan/clips.h"
#include "duet/metrics/detector.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/formats/people_formats.h"

namespace duet {
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
                           return naming_file(file, [&] {
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
  return task ? std::string(to_string(*task)) : shown(label);
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
                                 shown(source.clip)));
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

}  // namespace duet
