// Recordings of two people in, a curated data set of people and robots out: read, judged by the four gates (supplement
// B.2), retargeted for each robot, scored, written; one clip in memory per thread, resumable, the same bytes whatever
// the number of threads.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "duet/datasets/annotations.h"
#include "duet/datasets/curation.h"
#include "duet/datasets/entry.h"
#include "duet/formats/robot_motion_format.h"
#include "duet/motion/people/raw_people.h"
#include "duet/retarget/options.h"
#include "duet/robots/robot_model.h"

namespace duet {

struct DatasetRobot {
  std::string name;  // of its folder and columns: "g1"
  std::shared_ptr<const RobotModel> model;
};

struct DatasetPlan {
  std::vector<std::string> inputs;  // files and folders, as the user names them
  std::string format = {};          // of people/people_format.h; empty: recognised
  PeopleOptions people = {};
  CurationOptions curation = {};
  Annotations annotations = {};
  std::vector<DatasetRobot> robots = {};  // none: people only
  PairOptions pair = {};
  double pad_before = 0.0, pad_after = 0.0;  // of what is kept, after it was judged: both stand still so long [s]
  bool keep_rejected = false;                // retarget what a gate refuses, too
  int threads = 1;
};

// Events that a caller hears while it goes on; each may be empty. Called from any thread, one at a time.
struct DatasetEvents {
  std::function<void(int clips)> found = {};
  std::function<void(const DatasetEntry& entry, bool from_before)> finished = {};
  std::function<bool()> stop = {};  // asked before each clip
};

struct DatasetSummary {
  std::string format;
  int clips = 0, kept = 0, rejected = 0, other = 0, failed = 0;
  int from_before = 0;  // of these, finished by an earlier command
  bool stopped = false;
  std::map<std::string, double> seconds;  // of all threads, by stage: "read", "curate", "retarget", "score", "write"
};

// Throws InputError: no clip found, two clips of one name, the folder is another data set; StorageError.
DatasetSummary make_dataset(const DatasetPlan& plan, const std::string& folder, const DatasetEvents& events = {});

// The robots of a data set in a format of robot learning, with a manifest of what came from what. Resumable: what is
// there already and whole is not written again.

struct DatasetExport {
  int motions = 0;
  int from_before = 0;       // of these, written by an earlier command
  int objects_left_out = 0;  // of those written now, whose carried object the format has no place for
  bool stopped = false;
};

// OUTPUT/ROBOT/CLIP.ENDING (or a folder of that name) for each clip kept and each of its robots, and
// OUTPUT/manifest.json: clip, task, robot, source with its digest, files with theirs. `robots` are those of the data
// set by name. Throws InputError: no data set, a robot that is not given, a motion that is not there or was changed
// since (its digest); std::invalid_argument for a format that is only read; StorageError.
DatasetExport export_dataset(const std::string& dataset, const std::string& output,
                             const std::vector<DatasetRobot>& robots, const RobotMotionFormat& format,
                             const RobotMotionWriting& writing, int threads, const DatasetEvents& events = {});

}  // namespace duet
