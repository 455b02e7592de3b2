#include "duet/motion/people/source_clip.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "duet/core/require.h"
#include "duet/motion/carried_object.h"
#include "duet/motion/interaction_clip.h"
#include "duet/motion/people/made_up.h"
#include "duet/motion/people/people_detection.h"
#include "duet/motion/people/people_files.h"
#include "duet/motion/plausibility.h"

namespace duet {
namespace {

constexpr double kSlowest = 0.01, kFastest = 1e5;  // [Hz]
constexpr double kLevelArmSine = 0.34;             // arms of a T pose are within 20 degrees of level
constexpr double kStraightArmShare = 0.95;         // shoulder to wrist, of the arm's length
constexpr double kTPoseJump = 5.0,
                 kTPoseJumpMetres = 0.08;  // first step after a T pose: in steps that follow, at least

[[noreturn]] void refuse(const RawPeople& people, const std::string& fault) {
  throw InputError(fmt::format("'{}': {}", excerpt(people.name, kShownSentence), fault));
}

void check_sizes(const RawPeople& people, bool alone) {
  require(people.layout != nullptr, "people without a joint layout");
  const int columns = static_cast<int>(people.layout->names.size()) - people.layout->made_up;
  for (const PointTracks& joints : people.joints)
    if (joints.points() != columns && !(alone && joints.empty()))
      refuse(people, fmt::format("expected the {} joints of '{}', found {}", columns, excerpt(people.layout->name),
                                 joints.points()));
  const int a = people.joints[0].frames(), b = alone ? a : people.joints[1].frames();
  if (a != b) refuse(people, fmt::format("person A has {} frames and person B {}: expected the same", a, b));
  if (a < 2) refuse(people, fmt::format("expected at least 2 frames, found {}", a));
  for (const auto& rotations : people.rotations)
    if (!rotations.empty() && rotations.size() != static_cast<std::size_t>(a) * kSmplJoints)
      refuse(people,
             fmt::format("expected {} rotations (frames x 24) or none, found {}", a * kSmplJoints, rotations.size()));
  if (!people.object.empty() && people.object.size() != static_cast<std::size_t>(a))
    refuse(people, fmt::format("the object has {} poses and the people {} frames", people.object.size(), a));
}

PeopleFinding<double> find_rate_of(const RawPeople& people, const PeopleOptions& options) {
  const double rate_hz = options.rate_hz.value_or(people.rate_hz);
  if (!options.rate_hz && people.rate_hz == 0.0) refuse(people, "the file does not say its rate; state the rate");
  if (!(rate_hz >= kSlowest && rate_hz <= kFastest))
    refuse(people, fmt::format("a rate of {} Hz is out of range ({:g} to {:g} Hz)", rate_hz, kSlowest, kFastest));
  const std::string file =
      people.rate_hz == 0.0 ? "; the file does not say" : fmt::format("; the file: {:g} Hz", people.rate_hz);
  return {rate_hz, fmt::format("rate: {:g} Hz{}", rate_hz, options.rate_hz ? " (as told" + file + ")" : "")};
}

SmplFrame frame_in(const RawPeople& people, std::size_t who, int t, const WorldOfFile& world) {
  PointTracks moved(1, people.joints[who].points());
  moved.frame(0) = (world.M * people.joints[who].frame(t)).colwise() + world.p;
  SmplFrame smpl;
  make_smpl(*people.layout, std::as_const(moved).frame(0), true, smpl);
  return smpl;
}

bool has_t_pose(const RawPeople& people, std::size_t who, const WorldOfFile& world) {
  if (people.joints[who].frames() < 4) return false;
  const SmplFrame first = frame_in(people, who, 0, world), second = frame_in(people, who, 1, world),
                  third = frame_in(people, who, 2, world);
  for (const auto& [shoulder, elbow, wrist] :
       {std::array{kLeftShoulder, kLeftElbow, kLeftWrist}, std::array{kRightShoulder, kRightElbow, kRightWrist}}) {
    const Eigen::Vector3d arm = first.col(wrist) - first.col(shoulder);
    const double length =
        (first.col(elbow) - first.col(shoulder)).norm() + (first.col(wrist) - first.col(elbow)).norm();
    if (std::abs(arm.z()) > kLevelArmSine * arm.norm() || arm.norm() < kStraightArmShare * length) return false;
  }
  const double jump = (second - first).colwise().norm().maxCoeff();
  return jump > kTPoseJumpMetres && jump > kTPoseJump * (third - second).colwise().norm().maxCoeff();
}

PeopleFinding<bool> find_t_pose_of(const RawPeople& people, const WorldOfFile& world, const PeopleOptions& options) {
  if (options.drop_t_pose)
    return {*options.drop_t_pose, *options.drop_t_pose ? "frame 0 dropped (as told)" : "frame 0 kept (as told)"};
  const bool in_a = has_t_pose(people, 0, world), in_b = has_t_pose(people, 1, world);
  if (!in_a && !in_b) return {false, "frame 0 kept: not an added T pose"};
  return {true, fmt::format("frame 0 dropped: an added T pose{} (straight horizontal arms, then a jump)",
                            in_a && in_b ? ""
                            : in_a       ? " of person A"
                                         : " of person B")};
}

// The way from the file to the clip.
struct Plan {
  WorldOfFile world;
  bool mirrored = false;
  double metres_per_unit = 1.0;
  Axis up = Axis::kPlusZ;
  double rate_hz = 0.0;
  int first = 0;
  int frames = 0;  // of the clip
  double output_rate_hz = 50.0;
};

// Axes, mirror, level and floor, one after the other: each looks at people in the world that the ones before made.
void find_world(const RawPeople& people, const PeopleSamples& samples, const PeopleOptions& options, Plan& plan,
                std::vector<std::string>& evidence) {
  const SampledPeople raw = samples.in(plan.world, false);
  const PeopleFinding<double> unit = find_unit(people, raw, options);
  const PeopleFinding<Axis> up = find_up(people, raw, options);
  plan.metres_per_unit = unit.value;
  plan.up = up.value;
  plan.world.M = unit.value * rotation_of(up.value);
  const PeopleFinding<bool> mirror =
      find_mirror(samples.in(plan.world, false), samples.faces_in(plan.world), people.layout->has_toes(), options);
  plan.mirrored = mirror.value;
  if (mirror.value) plan.world.M.row(1) *= -1.0;
  const PeopleFinding<Eigen::Matrix3d> level = find_level(people, samples.in(plan.world, true), options);
  plan.world.M = level.value * plan.world.M;
  const PeopleFinding<double> floor = find_floor(samples.in(plan.world, true), options);
  plan.world.p.z() += floor.value;
  for (const std::string& sentence : {unit.sentence, up.sentence, mirror.sentence, level.sentence, floor.sentence})
    evidence.push_back(sentence);
}

Plan plan_of(const RawPeople& people, const PeopleOptions& options, std::vector<std::string>& evidence) {
  require(std::isfinite(options.output_rate_hz) && options.output_rate_hz > 0.0,
          "import: expected a positive output rate, found {} Hz", options.output_rate_hz);
  Plan plan;
  plan.output_rate_hz = options.output_rate_hz;
  find_world(people, PeopleSamples(people, people.joints[0].frames() > 4 ? 1 : 0), options, plan, evidence);
  const PeopleFinding<double> rate = find_rate_of(people, options);
  const PeopleFinding<bool> t_pose = find_t_pose_of(people, plan.world, options);
  plan.rate_hz = rate.value;
  plan.first = t_pose.value ? 1 : 0;
  const int frames = people.joints[0].frames() - plan.first;
  plan.frames = frames < 1 ? 0 : resampled_frames(frames, plan.rate_hz, plan.output_rate_hz);
  if (plan.frames < 2)
    refuse(people, fmt::format("{} frames at {:g} Hz are fewer than 2 frames at {:g} Hz", frames, plan.rate_hz,
                               plan.output_rate_hz));
  evidence.push_back(t_pose.sentence);
  evidence.push_back(fmt::format("{}; resampled: {} frames -> {} frames at {:g} Hz", rate.sentence, frames, plan.frames,
                                 plan.output_rate_hz));
  return plan;
}

// A rotation of the file's axes in W's, from SMPL's rest axes (left, up, forward) to those of docs/conventions.md
// (forward, left, up).
Eigen::Quaterniond rotation_in_world(const Eigen::Quaterniond& R_FJ, const Eigen::Quaterniond& R_WF) {
  Eigen::Matrix3d R_JB;
  R_JB << 0, 1, 0, 0, 0, 1, 1, 0, 0;
  return (R_WF * R_FJ * Eigen::Quaterniond(R_JB)).normalized();
}

Eigen::Quaterniond rotation_of(const Plan& plan) {
  return Eigen::Quaterniond(Eigen::Matrix3d(plan.world.M / plan.metres_per_unit)).normalized();
}

HumanMotion motion_of(const RawPeople& people, std::size_t who, const Plan& plan) {
  const PointTracks& source = people.joints[who];
  const std::vector<Eigen::Quaterniond>& rotations = people.rotations[who];
  HumanMotion motion{.rate_hz = plan.output_rate_hz, .joints = PointTracks(plan.frames, kSmplJoints), .rotations = {}};
  const bool turns = !rotations.empty() && !plan.mirrored;
  if (turns) motion.rotations.reserve(static_cast<std::size_t>(plan.frames) * kSmplJoints);
  const Eigen::Quaterniond R_WF = plan.mirrored ? Eigen::Quaterniond::Identity() : rotation_of(plan);
  PointTracks columns(1, source.points());
  for (int t = 0; t < plan.frames; ++t) {
    const FrameBetween at = frame_between(t * (plan.rate_hz / plan.output_rate_hz), source.frames() - plan.first);
    const int frame = plan.first + at.frame, next = at.part > 0.0 ? frame + 1 : frame;
    PointTracks::Frame moved = columns.frame(0);
    if (at.part > 0.0)
      moved.noalias() = plan.world.M * (source.frame(frame) + at.part * (source.frame(next) - source.frame(frame)));
    else
      moved.noalias() = plan.world.M * source.frame(frame);
    moved.colwise() += plan.world.p;
    make_smpl(*people.layout, std::as_const(columns).frame(0), true, motion.joints.frame(t));
    for (int j = 0; j < (turns ? kSmplJoints : 0); ++j) {
      const Eigen::Quaterniond& R = rotations[static_cast<std::size_t>(frame) * kSmplJoints + j];
      const Eigen::Quaterniond& R_next = rotations[static_cast<std::size_t>(next) * kSmplJoints + j];
      motion.rotations.push_back(rotation_in_world(at.part > 0.0 ? R.slerp(at.part, R_next) : R, R_WF));
    }
  }
  return motion;
}

// Without a shape an object is its origin.
CarriedObject object_of(const RawPeople& people, const PeopleOptions& options, const Plan& plan,
                        std::vector<std::string>& evidence) {
  CarriedObject object;
  if (people.object.empty() || plan.mirrored) {
    if (!people.object.empty()) evidence.emplace_back("object: left out, since the world is reflected");
    if (people.object.empty() && !options.object.empty())
      evidence.push_back(fmt::format("object: the file has none; '{}' is not used", file_name_of(options.object)));
    return object;
  }
  object.keypoints = options.object.empty() ? Eigen::Matrix3Xd::Zero(3, 1) : read_object_keypoints(options.object);
  evidence.push_back(
      options.object.empty()
          ? "object: its origin is its one keypoint; --object names a file of its shape"
          : fmt::format("object: {} keypoints of '{}'", object.keypoints.cols(), file_name_of(options.object)));
  object.poses.reserve(static_cast<std::size_t>(plan.frames));
  const Eigen::Quaterniond R_WF = rotation_of(plan);
  for (int t = 0; t < plan.frames; ++t) {
    const FrameBetween at =
        frame_between(t * (plan.rate_hz / plan.output_rate_hz), people.joints[0].frames() - plan.first);
    const Pose& before = people.object[plan.first + at.frame];
    const Pose X_FO = at.part > 0.0 ? interpolate(before, people.object[plan.first + at.frame + 1], at.part) : before;
    object.poses.push_back({(R_WF * X_FO.R).normalized(), plan.world.M * X_FO.p + plan.world.p});
  }
  return object;
}

Phases phases_of(const RawPeople& people, const Plan& plan, const InteractionClip& clip, std::string& sentence) {
  if (!people.phases) {
    const Phases phases = propose_phases(clip.a, clip.b, clip.task);
    sentence =
        fmt::format("phases: act [{}, {}) of {} frames (proposed)", phases.act_begin, phases.act_end, clip.frames());
    return phases;
  }
  const auto moved = [&](int frame) {
    return static_cast<int>(std::lround((frame - plan.first) * plan.output_rate_hz / plan.rate_hz));
  };
  const int begin = std::clamp(moved(people.phases->act_begin), 0, clip.frames() - 1);
  const int end = std::clamp(moved(people.phases->act_end), begin + 1, clip.frames());
  sentence = fmt::format("phases: act [{}, {}) of {} frames (the file's)", begin, end, clip.frames());
  return {.act_begin = begin, .act_end = end};
}

Task task_for(const RawPeople& people, const PeopleOptions& options) {
  if (options.task) return *options.task;
  if (people.task) return *people.task;
  const auto label = people.source.find("label");
  if (label == people.source.end()) refuse(people, "nothing says which task it is; state the task");
  refuse(people, fmt::format("its label '{}' is none of the tasks; state the task", excerpt(label->second)));
}

std::map<std::string, std::string> provenance(const RawPeople& people, const Plan& plan) {
  std::map<std::string, std::string> source = people.source;
  source["skeleton"] = people.layout->name;
  source["metres_per_unit"] = fmt::format("{}", plan.metres_per_unit);
  source["source_rate_hz"] = fmt::format("{}", plan.rate_hz);
  source["first_frame"] = fmt::format("{}", plan.first);
  source["up"] = std::string(to_string(plan.up));
  if (plan.mirrored) source["mirrored"] = "true";
  if (!people.phases) source["phases"] = "proposed";
  return source;
}

void judge(const RawPeople& people, const InteractionClip& clip, const PeopleOptions& options,
           std::vector<std::string>& evidence) {
  const Plausibility found = judge_people(clip);
  if (!found.faults.empty() && !options.as_is)
    refuse(people, found.faults.front() + " (--as-is takes it nevertheless)");
  for (const auto* sentences : {&found.faults, &found.oddities})
    for (const std::string& sentence : *sentences) evidence.push_back("not as expected: " + sentence);
}

}  // namespace

namespace {

// In place: gaps filled, a place for the partner of one alone, legs. What was made up is said and counted.
MadeUp make_up(RawPeople& people, bool alone, const PeopleOptions& options, std::vector<std::string>& evidence) {
  MadeUp made;
  if (const FilledGaps gaps = fill_gaps(people, options); gaps.gaps > 0) {
    evidence.push_back(gaps.sentence());
    made["gaps"] = static_cast<double>(std::ranges::count(gaps.frames, true)) / static_cast<double>(gaps.frames.size());
  }
  if (alone) people.joints[1] = people.joints[0];  // world and rate are found with him
  if (people.layout->made_up > 0) {
    evidence.push_back(add_legs(people, options));
    made["legs"] = 1.0;
  }
  return made;
}

// Where frames lie far apart, or at other times than the file's.
void count_rate(const RawPeople& people, const Plan& plan, MadeUp& made, std::vector<std::string>& evidence) {
  if (plan.rate_hz >= kLowRate && !people.uneven) return;
  made["rate"] = std::max(0.0, 1.0 - plan.rate_hz / plan.output_rate_hz);
  evidence.push_back(fmt::format("rate: {:.0f} % of the frames lie between recorded ones{}", 100.0 * made["rate"],
                                 people.uneven ? ", whose times are uneven" : ""));
}

}  // namespace

SourceClip clip_of(const RawPeople& given, const PeopleOptions& options) {
  RawPeople people = given;
  const bool alone = options.still_partner && people.joints[1].empty();
  check_sizes(people, alone);
  SourceClip result;
  result.evidence = people.evidence;
  const Task task = task_for(people, options);
  if (const auto label = people.source.find("label");
      label != people.source.end() && task_of_label(label->second) != task)
    result.evidence.push_back(
        fmt::format("task: {} (as told; its label is '{}')", to_string(task), excerpt(label->second)));
  MadeUp made = make_up(people, alone, options, result.evidence);
  try {
    const Plan plan = plan_of(people, options, result.evidence);
    count_rate(people, plan, made, result.evidence);
    InteractionClip& clip = result.clip;
    clip.id = people.id;
    clip.task = task;
    clip.a = motion_of(people, 0, plan);
    clip.b = alone ? still_partner(clip.a, task) : motion_of(people, 1, plan);
    if (alone) {
      made["partner"] = 1.0;
      result.evidence.push_back(
          fmt::format("partner: made up, stands still {:.2f} m in front",
                      (clip.a.joints.at(0, kPelvis) - clip.b.joints.at(0, kPelvis)).head<2>().norm()));
    }
    if (plan.mirrored && !people.rotations[0].empty())
      result.evidence.emplace_back("rotations: left out, since the world is reflected");
    clip.phases = {.act_begin = 0, .act_end = plan.frames};
    validate(clip);
    std::string sentence;
    clip.phases = phases_of(people, plan, clip, sentence);
    result.evidence.push_back(sentence);
    clip.source = provenance(people, plan);
    if (made.contains("gaps")) clip.source["interpolated"] = "true";
    put_made_up(made, clip.source);
    clip.object = object_of(people, options, plan, result.evidence);
    judge(people, clip, options, result.evidence);
    // The one who has the initiative is the robot's where nobody else acts.
    set_reactor(clip, options.reactor.value_or(people.reactor.value_or(alone ? Person::kA : Person::kB)));
  } catch (const std::invalid_argument& error) {
    refuse(people, error.what());
  }
  return result;
}

namespace {

[[noreturn]] void refuse_gap(const RawPeople& people, int who, int frame, int joint, const std::string& fault) {
  throw InputError(fmt::format("'{}': person {}, frame {}, joint '{}': {}", excerpt(people.name, kShownSentence),
                               who == 0 ? "A" : "B", frame, excerpt(people.layout->names[joint]), fault));
}

bool all_finite(const PointTracks& joints) {
  std::size_t others = 0;
  for (const double value : joints.data()) others += std::abs(value) <= std::numeric_limits<double>::max() ? 0 : 1;
  return others == 0;
}

// Frames [begin, end), of which one at least beside them is seen.
void fill(PointTracks& joints, int joint, int begin, int end) {
  const Eigen::Vector3d before = joints.at(begin > 0 ? begin - 1 : end, joint),
                        after = joints.at(end < joints.frames() ? end : begin - 1, joint);
  for (int t = begin; t < end; ++t)
    joints.at(t, joint) = before + (after - before) * (t - begin + 1.0) / (end - begin + 1.0);
}

void fill_joint(RawPeople& people, int who, int joint, const PeopleOptions& options, FilledGaps& count) {
  PointTracks& joints = people.joints[who];
  const int frames = joints.frames();
  const double rate_hz = options.rate_hz.value_or(people.rate_hz), longest = options.fill_gaps.value_or(kLongestUnseen);
  const auto seen = [&](int t) { return joints.at(t, joint).allFinite(); };
  for (int t = 0; t < frames; ++t) {
    if (seen(t)) continue;
    if (joints.at(t, joint).array().isInf().any()) refuse_gap(people, who, t, joint, "the position is infinite");
    if (!people.layout->has_gaps) refuse_gap(people, who, t, joint, "the position is not a number");
    int end = t;
    while (end < frames && !seen(end)) ++end;
    const bool at_end = t == 0 || end == frames;
    if (t == 0 && end == frames) refuse_gap(people, who, t, joint, "not seen in any frame");
    if (at_end && !options.fill_gaps)
      refuse_gap(people, who, t, joint,
                 fmt::format("not seen at the {} of the recording (--fill-gaps SECONDS holds the nearest position)",
                             t == 0 ? "begin" : "end"));
    if (!(rate_hz > 0.0) || end - t > longest * rate_hz)
      refuse_gap(people, who, t, joint,
                 fmt::format("not seen for {} frames, expected at most {} s (--fill-gaps SECONDS fills longer ones)",
                             end - t, longest));
    fill(joints, joint, t, end);
    ++count.gaps;
    count.values += end - t;
    count.longest = std::max(count.longest, end - t);
    count.held = count.held || at_end;
    std::fill(count.frames.begin() + t, count.frames.begin() + end, true);
    t = end;
  }
}

// Columns that some SMPL joint is made of; what the others hold is not looked at.
std::vector<bool> used_columns(const JointLayout& layout) {
  std::vector<bool> used(layout.names.size(), false);
  const auto use = [&](const std::vector<JointRecipe::Part>& parts) {
    for (const JointRecipe::Part& part : parts)
      if (part.column < static_cast<int>(used.size())) used[part.column] = true;
  };
  for (const JointRecipe& recipe : layout.smpl) use(recipe.parts), use(recipe.toward);
  use(layout.face);
  return used;
}

}  // namespace

std::string FilledGaps::sentence() const {
  return fmt::format(
      "gaps: {} stretches of a joint not seen, {} positions, the longest {} frames, filled along lines{}", gaps, values,
      longest, held ? ", at the ends with the nearest position" : "");
}

FilledGaps fill_gaps(RawPeople& people, const PeopleOptions& options) {
  require(!options.fill_gaps || (std::isfinite(*options.fill_gaps) && *options.fill_gaps >= 0.0),
          "--fill-gaps: expected seconds, 0 or more, found {}", options.fill_gaps.value_or(0.0));
  FilledGaps count;
  if (all_finite(people.joints[0]) && all_finite(people.joints[1])) return count;
  count.frames.resize(static_cast<std::size_t>(people.joints[0].frames()));
  const std::vector<bool> used = used_columns(*people.layout);
  for (const int who : {0, 1})
    for (int joint = 0; joint < people.joints[who].points(); ++joint)
      if (used[joint]) fill_joint(people, who, joint, options, count);
  return count;
}

}  // namespace duet
