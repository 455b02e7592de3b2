// The robots of a data set in a format of robot learning, with a manifest of what came from what. Resumable: what is
// there already and whole is not written again.
#pragma once

#include <functional>
#include <string>

#include "duet/datasets/dataset.h"
#include "duet/formats/robot_motion_format.h"

namespace duet {

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
