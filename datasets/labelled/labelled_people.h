// Recordings of two people whose label is known, read one at a time: clips of duet, or motions of others in any format
// of motion/people.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "duet/datasets/labelled/clip_labels.h"
#include "duet/motion/people/people_options.h"
#include "duet/tasks/rules/agent.h"

namespace duet {

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

}  // namespace duet
