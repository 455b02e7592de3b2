#include <fmt/format.h>

#include <algorithm>

#include "duet/archives/recording_file.h"
#include "duet/core/require.h"
#include "duet/formats/format_row.h"
#include "duet/formats/motion_source.h"
#include "duet/formats/motion_support.h"

namespace duet {
namespace {

constexpr Eigen::Index kFreeJoint = 7;   // numbers of a free joint in qpos
constexpr Eigen::Index kObjectPose = 7;  // an object's, after the robot's joints
constexpr std::size_t kMostObjects = 4;

void require_height(const MotionSource& source, const Eigen::MatrixXd& qpos) {
  if (qpos.rows() <= kFreeJoint)
    throw InputError(fmt::format("'{}': expected the root's 7 numbers and joint angles in a row, found {} columns",
                                 source.path, qpos.rows()));
}

// Joints of a row of `width` numbers that is the robot's, with the poses of objects after it: those of a whole robot
// where that leaves poses, else of one without wrists, else everything.
Eigen::Index joints_before_objects(const RobotModel& robot, Eigen::Index width, FileMotion& motion) {
  const auto wrists = static_cast<Eigen::Index>(robot.roles.wrists.size());
  for (const Eigen::Index joints : {Eigen::Index{robot.dof()}, robot.dof() - wrists}) {
    const Eigen::Index rest = width - kFreeJoint - joints;
    if (rest < 0 || rest % kObjectPose != 0 || rest > kObjectPose * static_cast<Eigen::Index>(kMostObjects)) continue;
    if (rest > 0) motion.evidence.push_back(fmt::format("{} objects after the joints: left out", rest / kObjectPose));
    return joints;
  }
  return width - kFreeJoint;
}

// ---- OmniRetarget

bool is_omniretarget(const MotionSource& source) {
  return source.has("qpos") && !source.has("frequency") && (source.has("human_joints") || source.has("fps"));
}

FileMotion read_omniretarget(const MotionSource& source, const RobotModel& robot,
                             const RobotMotionOptions& /*options*/) {
  FileMotion motion{.path = source.path};
  const Eigen::MatrixXd qpos = matrix_of(*source.npz, "qpos");
  require_height(source, qpos);
  take_qpos(qpos, joints_before_objects(robot, qpos.rows(), motion), motion);
  if (source.has("fps")) motion.rate_hz = source.npz->number_or_text("fps");
  return motion;
}

// ---- SPIDER

bool is_spider(const MotionSource& source) {
  return source.has("qpos") && source.has("qvel") && !source.has("frequency") && !is_omniretarget(source);
}

// (T, n), or (steps, substeps, n): then every substep is a frame.
FileMotion read_spider(const MotionSource& source, const RobotModel& robot, const RobotMotionOptions& /*options*/) {
  FileMotion motion{.path = source.path};
  const Eigen::MatrixXd qpos = matrix_of(*source.npz, "qpos");
  const std::vector<std::size_t>& shape = source.npz->array("qpos").shape;
  if (shape.size() == 3)
    motion.evidence.push_back(fmt::format("{} steps of {} substeps: every substep is a frame", shape[0], shape[1]));
  require_height(source, qpos);
  take_qpos(qpos, joints_before_objects(robot, qpos.rows(), motion), motion);
  return motion;
}

// ---- LocoMuJoCo

bool is_locomujoco(const MotionSource& source) {
  return source.has("qpos") && source.has("joint_names") && source.has("frequency");
}

// Frames of one trajectory of several: [first, last).
std::pair<Eigen::Index, Eigen::Index> chosen_frames(const MotionSource& source, Eigen::Index frames,
                                                    const std::string& motion) {
  if (!source.has("split_points")) return {0, frames};
  const std::vector<std::int64_t> points = source.npz->integers("split_points", {-1});
  for (std::size_t i = 0; i + 1 < points.size(); ++i)
    if (points[i] < 0 || points[i] >= points[i + 1] || points[i + 1] > frames)
      throw InputError(fmt::format("'{}': array 'split_points': expected ascending frames up to {}, found {} and {}",
                                   source.path, frames, points[i], points[i + 1]));
  if (points.size() < 2) return {0, frames};
  const std::size_t count = points.size() - 1;
  if (motion.empty() && count > 1)
    throw InputError(fmt::format("'{}': holds {} motions, name one of them: 0 to {}", source.path, count, count - 1));
  const std::optional<double> number = motion.empty() ? 0.0 : parse_number(motion);
  for (std::size_t i = 0; i < count; ++i)
    if (number && *number == static_cast<double>(i)) return {points[i], points[i + 1]};
  throw InputError(fmt::format("'{}': no motion '{}', expected 0 to {}", source.path, excerpt(motion), count - 1));
}

FileMotion read_locomujoco(const MotionSource& source, const RobotModel& /*robot*/, const RobotMotionOptions& options) {
  const Npz& npz = *source.npz;
  FileMotion motion{
      .path = source.path, .rate_hz = npz.number_or_text("frequency"), .joint_names = npz.strings("joint_names", {-1})};
  const Eigen::MatrixXd qpos = matrix_of(npz, "qpos");
  const auto joints = static_cast<Eigen::Index>(motion.joint_names.size()) - 1;
  if (joints < 1 || qpos.rows() != kFreeJoint + joints)
    throw InputError(fmt::format("'{}': expected a free joint and {} hinges as named, 7 + {} columns of qpos, found {}",
                                 source.path, joints, joints, qpos.rows()));
  if (source.has("jnt_type")) {
    const std::vector<std::int64_t> types = npz.integers("jnt_type", {joints + 1});
    if (types.front() != 0 || std::any_of(types.begin() + 1, types.end(), [](std::int64_t t) { return t != 3; }))
      throw InputError(fmt::format("'{}': array 'jnt_type': expected a free joint (0) and hinges (3)", source.path));
  }
  motion.joint_names.erase(motion.joint_names.begin());
  const auto [first, last] = chosen_frames(source, qpos.cols(), options.motion);
  take_qpos(qpos.middleCols(first, last - first), joints, motion);
  if (source.has("body_names") && source.has("xpos") && last - first == qpos.cols()) {
    motion.body_names = npz.strings("body_names", {-1});
    motion.bodies = npz.tracks("xpos", static_cast<int>(motion.body_names.size()));
    if (motion.bodies.frames() != motion.frames()) motion.bodies = {};
  }
  return motion;
}

// ---- PHUMA: an array of [joints, position, quaternion]

bool is_phuma(const MotionSource& source) {
  return source.npy && source.npy->shape.size() == 2 && source.npy->shape[1] > static_cast<std::size_t>(kFreeJoint) &&
         std::holds_alternative<std::vector<double>>(source.npy->values);
}

FileMotion read_phuma(const MotionSource& source, const RobotModel& /*robot*/, const RobotMotionOptions& /*options*/) {
  const Eigen::MatrixXd rows = columns_of(std::get<std::vector<double>>(source.npy->values), source.npy->shape[1]);
  const Eigen::Index joints = rows.rows() - kFreeJoint;
  FileMotion motion{.path = source.path, .q = rows.topRows(joints)};
  for (Eigen::Index t = 0; t < rows.cols(); ++t) {
    motion.position.emplace_back(rows.col(t).segment<3>(joints));
    motion.quaternion.emplace_back(rows.col(t).tail<4>());
  }
  return motion;
}

// ---- duet's own

std::string schema_of(const MotionSource& source) {
  if (!source.has("schema")) return "";
  const auto* text = std::get_if<std::vector<std::string>>(&source.npz->array("schema").values);
  return text != nullptr && text->size() == 1 ? text->front() : "";
}

bool is_recording(const MotionSource& source) { return schema_of(source) == "duet.recording"; }
bool is_paired(const MotionSource& source) { return schema_of(source) == "duet.paired_motion"; }

// The robot's states; its joints are the card's.
FileMotion read_duet_recording(const MotionSource& source, const RobotModel& robot,
                               const RobotMotionOptions& /*options*/) {
  const Recording recording = read_recording(*source.npz);
  FileMotion motion{.path = source.path, .rate_hz = recording.rate_hz};
  const auto joints = recording.robot.empty() ? 0 : recording.robot.front().q.size();
  motion.q.resize(joints, recording.frames());
  for (int t = 0; t < recording.frames(); ++t) {
    const RobotState& state = recording.robot[static_cast<std::size_t>(t)];
    motion.position.push_back(state.X_WB.p);
    motion.quaternion.emplace_back(state.X_WB.R.w(), state.X_WB.R.x(), state.X_WB.R.y(), state.X_WB.R.z());
    motion.q.col(t) = state.q;
  }
  if (joints == robot.dof()) motion.joint_names = robot.joint_names();
  return motion;
}

FileMotion read_paired_robot(const MotionSource& source, const RobotModel& /*robot*/,
                             const RobotMotionOptions& /*options*/) {
  const Npz& npz = *source.npz;
  FileMotion motion{.path = source.path,
                    .rate_hz = npz.number("rate_hz"),
                    .position = vectors_of(npz.numbers("robot_root_position", {-1, 3})),
                    .quaternion = quaternions_of(npz.numbers("robot_root_quat_wxyz", {-1, 4})),
                    .joint_names = npz.strings("robot_joint_names", {-1})};
  const auto joints = static_cast<long>(motion.joint_names.size());
  motion.q = columns_of(npz.numbers("robot_q", {-1, joints}), motion.joint_names.size());
  return motion;
}

// Played back without physics: the reference is the state.
MotionFiles write_duet_recording(const RobotMotion& motion, const RobotModel& /*robot*/,
                                 const RobotMotionWriting& /*writing*/) {
  std::vector<Eigen::Quaterniond> rotations;
  for (const Pose& X_WB : motion.root) rotations.push_back(X_WB.R);
  const Eigen::MatrixXd v = rate_of_change(root_positions(motion), motion.rate_hz);
  const Eigen::MatrixXd w = angular_velocity(rotations, motion.rate_hz), qd = rate_of_change(motion.q, motion.rate_hz);
  Recording recording;
  recording.phases = {.act_begin = 0, .act_end = motion.frames()};
  recording.rate_hz = motion.rate_hz;
  for (int t = 0; t < motion.frames(); ++t) {
    const Pose& X_WB = motion.root[static_cast<std::size_t>(t)];
    recording.robot.push_back({.X_WB = X_WB,
                               .v_WB = v.col(t),
                               .w_WB_B = X_WB.R.conjugate() * Eigen::Vector3d(w.col(t)),
                               .q = motion.q.col(t),
                               .v = qd.col(t)});
    recording.reference.push_back(motion.reference(t));
    recording.q_target.push_back(motion.q.col(t));
  }
  return {{"", recording_npz(recording).bytes()}};
}

}  // namespace

std::vector<RobotMotionFormat> qpos_formats() {
  constexpr MotionLayout kMujoco = {.quaternion = QuaternionOrder::kWxyz};
  MotionLayout omniretarget = kMujoco, spider = kMujoco;
  omniretarget.rate_hz = 30.0;
  spider.rate_hz = 50.0;
  return {
      {.name = "duet",
       .about = "duet's recording; written as one that is played back without physics",
       .holds = "NPZ: see \"Recording\"",
       .evidence = "core/recording.h",
       .licence = "of duet",
       .ending = ".npz",
       .container = MotionContainer::kNpz,
       .layout = kMujoco,
       .recognises = is_recording,
       .read = read_duet_recording,
       .write = write_duet_recording},
      {.name = "paired",
       .about = "the robot of a paired motion (`duet retarget`)",
       .holds = "NPZ: see \"Paired motion\"",
       .evidence = "motion/paired_motion.h",
       .licence = "of duet",
       .ending = ".npz",
       .container = MotionContainer::kNpz,
       .layout = kMujoco,
       .recognises = is_paired,
       .read = read_paired_robot},
      {.name = "phuma",
       .about = "PHUMA's arrays: joints first, 23 without wrists",
       .holds = "NPY (T, n + 7): joint angles, root position, root quaternion",
       .evidence = "DAVIAN-Robotics/PHUMA src/retarget/motion_adaptation.py",
       .licence = "data: see its README (non-commercial parts)",
       .ending = ".npy",
       .container = MotionContainer::kNpy,
       .layout = {.quaternion = QuaternionOrder::kXyzw, .rate_hz = 30.0},
       .holds_rate = false,
       .recognises = is_phuma,
       .read = read_phuma},
      {.name = "omniretarget",
       .about = "OmniRetarget's raw results; objects after the joints are left out",
       .holds = "NPZ: qpos (T, 7 + n [+ 7 an object]), human_joints, fps, cost",
       .evidence = "amazon-far/holosoma interaction_mesh_retargeter.py",
       .licence = "Apache-2.0 (code), MIT (data)",
       .ending = ".npz",
       .container = MotionContainer::kNpz,
       .layout = omniretarget,
       .recognises = is_omniretarget,
       .read = read_omniretarget},
      {.name = "locomujoco",
       .about = "LocoMuJoCo 1.x trajectories; of several motions one is chosen by its number",
       .holds = "NPZ: qpos (T, 7 + n), joint_names (the free joint first), frequency, jnt_type, split_points, "
                "body_names, xpos",
       .evidence = "robfiras/loco-mujoco loco_mujoco/trajectory/dataclasses.py",
       .licence = "MIT (code)",
       .ending = ".npz",
       .container = MotionContainer::kNpz,
       .layout = kMujoco,
       .recognises = is_locomujoco,
       .read = read_locomujoco},
      {.name = "spider",
       .about = "SPIDER's trajectory_kinematic, trajectory_ik, trajectory_mjwp; the rate stands beside them (ref_dt)",
       .holds = "NPZ: qpos (T, 7 + n) or (steps, substeps, 7 + n), qvel, ctrl, contact",
       .evidence = "facebookresearch/spider spider/process_datasets/gmr.py",
       .licence = "CC BY-NC 4.0",
       .ending = ".npz",
       .container = MotionContainer::kNpz,
       .layout = spider,
       .holds_rate = false,
       .recognises = is_spider,
       .read = read_spider},
  };
}

}  // namespace duet
