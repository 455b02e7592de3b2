// BVH motion capture: a reader of one file, and the import of two people (a pair
// of files, or one file that holds both) as SMPL-24. Habits of single makers are
// taken and, where they tell something, noted: keywords in any case, names of
// joints with blanks, more frames than announced, position channels that nobody
// filled.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/robot_state.h"
#include "duet/motion/interaction_clip.h"

namespace duet {

struct BvhJoint {
  std::string name;  // "End Site" of joint X is named "X/end"
  int parent = -1;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // in file units
  std::vector<int> channels;                         // 0..2 = X,Y,Z position, 3..5 = X,Y,Z rotation, in file order
  bool keeps_offset = false;                         // its position channels are 0 in all frames, its
                                                     // OFFSET is not: they say nothing
};

struct Bvh {
  std::string name;  // file name, for messages
  std::vector<BvhJoint> joints;
  double frame_time = 0.0;  // [s]
  int frames = 0;
  std::vector<double> values;           // (frames, channels), file units and degrees
  std::vector<std::string> notes = {};  // what is unusual and was taken, one sentence each
};

// Throws InputError naming file, line, expected and found: truncated or empty
// text, an unknown channel, a frame with too few numbers, a number that is not
// finite, a frame time that is not positive, no frames. Several ROOTs are read;
// a joint's name stands once below each.
Bvh parse_bvh(std::string_view text, const std::string& name);
Bvh read_bvh(const std::string& path);

enum class UpAxis { kY, kZ };

struct BvhOptions {  // empty = detected; the verdict says what was found and from what
  std::optional<double> metres_per_unit = {};
  std::optional<UpAxis> up = {};
  std::optional<double> rate_hz = {};    // overrides the frame time
  std::optional<bool> drop_t_pose = {};  // an added T pose in frame 0
  double output_rate_hz = 50.0;
  std::string skeleton = {};  // the user's file of names (motion/layouts/joint_recipes.h);
                              // empty: known namings
};

struct BvhImport {
  InteractionClip clip;
  std::vector<std::string> verdict;  // one line per detected or overridden fact, for the user to read
};

// Person A from the first file, B from the second. For files of different lengths
// the common one is taken, with a note. Missing joints, different rates:
// InputError.
BvhImport import_bvh_pair(const std::string& path_a, const std::string& path_b, Task task,
                          const BvhOptions& options = {});
BvhImport import_bvh_pair(const Bvh& a, const Bvh& b, Task task, const BvhOptions& options = {});

// Poses of a BVH skeleton, in the file's axes and units. Thread-safe.

// Pose of each joint in its parent at a frame. Rotation channels multiply in
// file order; a position channel replaces that component of the OFFSET (as
// Blender and MotionBuilder read it), unless the joint keeps it.
std::vector<Pose> local_poses(const Bvh& bvh, int frame);

// The same at a time between two frames: slerp of rotations, linear positions. `index` counts frames and may be
// fractional; exact where it is whole.
std::vector<Pose> local_poses_at(const Bvh& bvh, double index);

// The posture of the hierarchy itself: offsets only.
std::vector<Pose> zero_local_poses(const Bvh& bvh);

// Poses in the world from poses in the parents.
std::vector<Pose> global_poses(const Bvh& bvh, const std::vector<Pose>& local);

}  // namespace duet
