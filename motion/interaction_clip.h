// Two people, one task: the input of the benchmark. Both share world frame, clock, rate and length.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/archives/zip/zip.h"
#include "duet/core/task.h"
#include "duet/motion/carried_object.h"
#include "duet/motion/human_motion.h"

namespace duet {

class Npz;

// Frames [begin, end) during which two joints are meant to be in touch; joints are SMPL-24 indices.
struct ContactWindow {
  int begin = 0;
  int end = 0;
  int joint_a = 0;
  int joint_b = 0;
  bool operator==(const ContactWindow&) const = default;
};

struct InteractionClip {
  std::string id;  // names the clip in files, seeds and tables
  Task task = Task::kHug;
  HumanMotion a;
  HumanMotion b;
  Phases phases;
  Person reactor = Person::kB;                // who the robot replaces (H_s); the other stays human (H_p). Decision 1.
  std::vector<ContactWindow> contacts;        // known by construction for synthetic clips, else empty
  std::map<std::string, std::string> source;  // provenance: files, seed, detected units, ...
  CarriedObject object = {};                  // that the two handle; empty: none

  [[nodiscard]] int frames() const { return a.frames(); }
  [[nodiscard]] double rate_hz() const { return a.rate_hz; }
  [[nodiscard]] const HumanMotion& reactor_motion() const { return reactor == Person::kA ? a : b; }
  [[nodiscard]] const HumanMotion& actor_motion() const { return reactor == Person::kA ? b : a; }
};

// Throws std::invalid_argument: what validate(HumanMotion) says of either, different lengths or rates, phases or
// contact windows outside the clip, what validate(CarriedObject) says.
void validate(const InteractionClip& clip);

// NPZ with the keys of docs/file-formats.md. Loading validates, and proposes the phases where the file has none
// (motion/interaction_clip.h; `source` then has "phases": "proposed"). Throw InputError naming the file, the key and
// the fault. Saving validates first (std::invalid_argument).
void save_clip(const InteractionClip& clip, const std::string& path);
InteractionClip load_clip(const std::string& path);
// The same without a file; `name` stands in messages.
std::string clip_bytes(const InteractionClip& clip, ZipMethod method = ZipMethod::kDeflated);
InteractionClip parse_clip(std::string_view bytes, const std::string& name);
InteractionClip read_clip(const Npz& npz);

// Sets the person whom the robot replaces. Another person than before gives another id, "-A" or "-B" at its end, and
// back the first one: the two are different clips and may be in one run.
void set_reactor(InteractionClip& clip, Person reactor);

// Both people stand as in their first frame for `before` seconds, and as in their last for `after`: for recordings that
// were cropped to the act. Phases and contact windows move along. Throws std::invalid_argument for a time that is
// negative or not finite.
InteractionClip padded(const InteractionClip& clip, double before, double after);

// Mirror image in the plane y = 0 with left and right joints (also of the contact windows) exchanged.
InteractionClip mirrored(const InteractionClip& clip);

// Automatic proposal of the three phases for a clip without annotations (supplement B.4 annotated by hand).

// Phases from the two motions alone: the approach ends when the roots' distance stops shrinking and the hands begin the
// act; the follow-up begins when the hands are back and the roots part. Always act_begin < act_end. The method stands
// in docs/conventions.md.
Phases propose_phases(const HumanMotion& a, const HumanMotion& b, Task task);

}  // namespace duet
