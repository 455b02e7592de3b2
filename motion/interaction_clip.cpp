#include "duet/motion/interaction_clip.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/synthetic_id.h"
#include "duet/motion/npz_fields.h"
#include "duet/motion/phase_proposal.h"

namespace duet {
namespace {

constexpr const char* kSchema = "duet.interaction_clip";
constexpr std::int64_t kSchemaVersion = 1;

void check_contact(const InteractionClip& clip, const ContactWindow& window, std::size_t index) {
  require(0 <= window.begin && window.begin < window.end && window.end <= clip.frames(),
          "clip '{}': contact window {}: expected 0 <= begin < end <= {} frames, found [{}, {})", clip.id, index,
          clip.frames(), window.begin, window.end);
  for (const int joint : {window.joint_a, window.joint_b})
    require(0 <= joint && joint < kSmplJoints, "clip '{}': contact window {}: expected joints 0..{}, found {}", clip.id,
            index, kSmplJoints - 1, joint);
}

void put_contacts(Npz& npz, const std::vector<ContactWindow>& contacts) {
  std::vector<std::int64_t> values;
  for (const ContactWindow& window : contacts)
    values.insert(values.end(), {window.begin, window.end, window.joint_a, window.joint_b});
  npz.set("contacts", std::move(values), {contacts.size(), 4});
}

// The joint numbers of the file count its own columns.
std::vector<ContactWindow> get_contacts(const Npz& npz, const std::vector<int>& columns) {
  std::vector<ContactWindow> contacts;
  if (!npz.contains("contacts")) return contacts;
  std::vector<int> joint_of_column(kSmplJoints);
  for (int joint = 0; joint < kSmplJoints; ++joint) joint_of_column[columns[joint]] = joint;
  const std::vector<std::int64_t> values = npz.integers("contacts", {-1, 4});
  for (std::size_t i = 0; i + 3 < values.size(); i += 4) {
    for (std::size_t k = 0; k < 4; ++k)
      if (values[i + k] < 0 || values[i + k] >= (k < 2 ? std::int64_t{1} << 30 : kSmplJoints))
        throw InputError(fmt::format("'{}': key 'contacts': row {}, column {}: {} is out of range", npz.name(), i / 4,
                                     k, values[i + k]));
    contacts.push_back({.begin = static_cast<int>(values[i]),
                        .end = static_cast<int>(values[i + 1]),
                        .joint_a = joint_of_column[values[i + 2]],
                        .joint_b = joint_of_column[values[i + 3]]});
  }
  return contacts;
}

// Takes the file's phases, or a proposal, which is said in `source`. Two lengths are left to validate().
void take_phases(const Npz& npz, InteractionClip& clip) {
  if (npz.contains("phases")) {
    clip.phases = get_phases(npz);
  } else if (clip.a.frames() == clip.b.frames()) {
    clip.phases = propose_phases(clip.a, clip.b, clip.task);
    clip.source["phases"] = "proposed";
  }
}

HumanMotion mirrored(const HumanMotion& motion) {
  HumanMotion result = motion;
  for (int t = 0; t < motion.frames(); ++t) {
    for (int j = 0; j < kSmplJoints; ++j) {
      result.joints.at(t, j) = motion.joints.at(t, kSmplMirror[j]);
      result.joints.at(t, j).y() *= -1.0;
    }
    for (int j = 0; j < (motion.rotations.empty() ? 0 : kSmplJoints); ++j) {
      const std::size_t row = static_cast<std::size_t>(t) * kSmplJoints;
      const Eigen::Quaterniond& R = motion.rotations[row + kSmplMirror[j]];
      result.rotations[row + j] = Eigen::Quaterniond(R.w(), -R.x(), R.y(), -R.z());  // S R S, S = diag(1, -1, 1)
    }
  }
  return result;
}

}  // namespace

void validate(const InteractionClip& clip) {
  validate(clip.a, fmt::format("clip '{}', person A", clip.id));
  validate(clip.b, fmt::format("clip '{}', person B", clip.id));
  require(clip.a.frames() == clip.b.frames(),
          "clip '{}': expected two people of the same length, found {} and {} frames", clip.id, clip.a.frames(),
          clip.b.frames());
  require(clip.a.rate_hz == clip.b.rate_hz, "clip '{}': expected two people at the same rate, found {} and {} Hz",
          clip.id, clip.a.rate_hz, clip.b.rate_hz);
  require(0 <= clip.phases.act_begin && clip.phases.act_begin <= clip.phases.act_end &&
              clip.phases.act_end <= clip.frames(),
          "clip '{}': expected phases with 0 <= act_begin <= act_end <= {} frames, found [{}, {})", clip.id,
          clip.frames(), clip.phases.act_begin, clip.phases.act_end);
  for (std::size_t i = 0; i < clip.contacts.size(); ++i) check_contact(clip, clip.contacts[i], i);
  validate(clip.object, clip.frames(), fmt::format("clip '{}', object", clip.id));
}

InteractionClip read_clip(const Npz& npz) {
  check_schema(npz, kSchema, kSchemaVersion,
               {"id", "task", "reactor", "phases", "rate_hz", "human_joint_names", "a_joints", "a_rotations_wxyz",
                "b_joints", "b_rotations_wxyz", "contacts", "source_names", "source_values", "object_position",
                "object_quat_wxyz", "object_keypoints"},
               {});
  const double rate_hz = get_rate(npz);
  const std::vector<int> columns = get_joint_columns(npz);
  InteractionClip clip{.id = get_id(npz, "id"),
                       .task = get_task(npz),
                       .a = get_motion(npz, "a", rate_hz, columns),
                       .b = get_motion(npz, "b", rate_hz, columns),
                       .phases = {},
                       .reactor = get_reactor(npz),
                       .contacts = get_contacts(npz, columns),
                       .source = get_texts(npz, "source"),
                       .object = get_object(npz)};
  take_phases(npz, clip);
  check_archive(npz, [&] { validate(clip); });
  return clip;
}

std::string clip_bytes(const InteractionClip& clip, ZipMethod method) {
  validate(clip);
  Npz npz;
  put_schema(npz, kSchema, kSchemaVersion);
  npz.set_text("id", clip.id);
  put_task(npz, clip.task, clip.reactor, clip.phases, clip.rate_hz());
  put_joint_names(npz);
  put_motion(npz, "a", clip.a);
  put_motion(npz, "b", clip.b);
  put_contacts(npz, clip.contacts);
  put_texts(npz, "source", clip.source);
  put_object(npz, clip.object);
  return npz.bytes(method);
}

InteractionClip parse_clip(std::string_view bytes, const std::string& name) {
  return read_clip(Npz::parse(bytes, name));
}

void save_clip(const InteractionClip& clip, const std::string& path) { write_file(path, clip_bytes(clip)); }

InteractionClip load_clip(const std::string& path) { return read_clip(Npz::load(path)); }

void set_reactor(InteractionClip& clip, Person reactor) {
  if (clip.reactor == reactor) return;
  clip.id = id_in_other_role(clip.id, clip.reactor == Person::kA ? 'A' : 'B');
  clip.reactor = reactor;
}

namespace {

// `before` copies of the first frame, the frames, `after` copies of the last.
HumanMotion held(const HumanMotion& motion, int before, int after) {
  const int frames = motion.frames();
  const std::size_t per_frame = motion.rotations.size() / static_cast<std::size_t>(frames);
  HumanMotion result{.rate_hz = motion.rate_hz,
                     .joints = PointTracks(before + frames + after, motion.joints.points()),
                     .rotations = {}};
  for (int t = 0; t < result.frames(); ++t) {
    const int source = std::clamp(t - before, 0, frames - 1);
    result.joints.frame(t) = motion.joints.frame(source);
    const auto first = motion.rotations.begin() + static_cast<std::ptrdiff_t>(source * per_frame);
    result.rotations.insert(result.rotations.end(), first, first + static_cast<std::ptrdiff_t>(per_frame));
  }
  return result;
}

}  // namespace

InteractionClip padded(const InteractionClip& clip, double before, double after) {
  for (const double time : {before, after})
    require(std::isfinite(time) && time >= 0.0, "padding: expected seconds, found {}", time);
  const int first = static_cast<int>(std::lround(before * clip.rate_hz()));
  const int last = static_cast<int>(std::lround(after * clip.rate_hz()));
  InteractionClip result = clip;
  result.a = held(clip.a, first, last);
  result.b = held(clip.b, first, last);
  result.object = held(clip.object, first, last);
  result.phases.act_begin += first;
  result.phases.act_end += first;
  for (ContactWindow& window : result.contacts) {
    window.begin += first;
    window.end += first;
  }
  return result;
}

InteractionClip mirrored(const InteractionClip& clip) {
  InteractionClip result = clip;
  result.a = mirrored(clip.a);
  result.b = mirrored(clip.b);
  result.object = mirrored(clip.object);
  for (ContactWindow& window : result.contacts) {
    window.joint_a = kSmplMirror[window.joint_a];
    window.joint_b = kSmplMirror[window.joint_b];
  }
  return result;
}

}  // namespace duet
