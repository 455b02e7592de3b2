// The result of retargeting a clip: the robot's motion, the adapted human partner, what they came from, and how it
// went.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/recording.h"
#include "duet/core/task.h"
#include "duet/motion/interaction_clip.h"

namespace duet {

struct PairedMotion {
  std::string clip_id;
  Task task = Task::kHug;
  Phases phases;
  Person reactor = Person::kB;
  RobotMotion robot;           // replaces the reactor, H_s
  HumanMotion partner;         // adapted H_p
  HumanMotion source_partner;  // H_p as in the clip
  HumanMotion source_reactor;  // H_s as in the clip
  PointTracks reshaped;        // (T, 16, 3): Reshaped(H_s) at the 16 pairs of A.1.1; empty: not known, no JPE then
  std::map<std::string, std::vector<double>>
      loss;  // per term ("total", "kin", "con", "hum", "temp", "pose"), one per iteration
  std::map<std::string, std::string> settings;  // every option of the solver, kernel and robot, as text
  CarriedObject object = {};                    // of the clip, where it was there; empty: none
  Tags tags = {};                               // of a suite's clip, for its rows (core/task.h)

  [[nodiscard]] int frames() const { return robot.frames(); }
};

// Throws std::invalid_argument naming the part: what the validations of the four motions say, different lengths or
// rates, phases outside.
void validate(const PairedMotion& motion);

// NPZ with the keys of docs/file-formats.md. Throw InputError naming file, key and fault. Saving validates first
// (std::invalid_argument).
void save_paired_motion(const PairedMotion& motion, const std::string& path);
PairedMotion load_paired_motion(const std::string& path);
// The same without a file; `name` stands in messages.
std::string paired_motion_bytes(const PairedMotion& motion, ZipMethod method = ZipMethod::kDeflated);
PairedMotion parse_paired_motion(std::string_view bytes, const std::string& name);
PairedMotion read_paired_motion(const Npz& npz);

// A digest that tells whether two motions come from one clip, whatever they were called: for data splits.

// SHA-256 over task, phases and both people's joints as they were before retargeting, to a tenth of a millimetre.
std::string clip_digest(const PairedMotion& motion);

}  // namespace duet
