#include "duet/motion/paired_motion.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/npz_fields.h"

namespace duet {
namespace {

constexpr const char* kPairedSchema = "duet.paired_motion";
constexpr std::int64_t kPairedVersion = 1;
constexpr const char* kLossPrefix = "loss_";

void check_same_time(const PairedMotion& motion) {
  for (const auto& [who, human] : {std::pair<const char*, const HumanMotion*>{"partner", &motion.partner},
                                   {"source_partner", &motion.source_partner},
                                   {"source_reactor", &motion.source_reactor}}) {
    require(human->frames() == motion.frames(), "{}: expected the robot's {} frames, found {}", who, motion.frames(),
            human->frames());
    require(human->rate_hz == motion.robot.rate_hz, "{}: expected the robot's rate of {} Hz, found {} Hz", who,
            motion.robot.rate_hz, human->rate_hz);
  }
  require(motion.reshaped.empty() || motion.reshaped.frames() == motion.frames(),
          "reshaped: expected the robot's {} frames, found {}", motion.frames(), motion.reshaped.frames());
  require(0 <= motion.phases.act_begin && motion.phases.act_begin <= motion.phases.act_end &&
              motion.phases.act_end <= motion.frames(),
          "phases: expected 0 <= act_begin <= act_end <= {} frames, found [{}, {})", motion.frames(),
          motion.phases.act_begin, motion.phases.act_end);
  validate(motion.object, motion.frames(), "object");
}

void put_robot(Npz& npz, const RobotMotion& robot) {
  const std::size_t frames = robot.root.size();
  npz.set("robot_joint_names", robot.joint_names);
  std::vector<double> positions;
  std::vector<Eigen::Quaterniond> rotations;
  for (const Pose& X_WB : robot.root) {
    positions.insert(positions.end(), {X_WB.p.x(), X_WB.p.y(), X_WB.p.z()});
    rotations.push_back(X_WB.R);
  }
  npz.set("robot_root_position", std::move(positions), {frames, 3});
  put_quaternions(npz, "robot_root_quat_wxyz", rotations, {frames, 4});
  // Column-major (joints, T) has the bytes of row-major (T, joints).
  npz.set("robot_q", std::vector<double>(robot.q.data(), robot.q.data() + robot.q.size()),
          {frames, static_cast<std::size_t>(robot.q.rows())});
}

RobotMotion get_robot(const Npz& npz, double rate_hz) {
  RobotMotion robot{.rate_hz = rate_hz, .joint_names = npz.strings("robot_joint_names", {-1}), .root = {}, .q = {}};
  const std::vector<double> positions = npz.numbers("robot_root_position", {-1, 3});
  const long frames = static_cast<long>(positions.size() / 3);
  const long joints = static_cast<long>(robot.joint_names.size());
  const std::vector<Eigen::Quaterniond> rotations = get_quaternions(npz, "robot_root_quat_wxyz", {frames, 4});
  for (long t = 0; t < frames; ++t)
    robot.root.push_back({.R = rotations[t], .p = Eigen::Map<const Eigen::Vector3d>(&positions[3 * t])});
  const std::vector<double> q = npz.numbers("robot_q", {frames, joints});
  robot.q = Eigen::Map<const Eigen::MatrixXd>(q.data(), joints, frames);
  check_archive(npz, [&] { validate(robot, "robot"); });
  return robot;
}

}  // namespace

PairedMotion read_paired_motion(const Npz& npz) {
  check_schema(npz, kPairedSchema, kPairedVersion,
               {"clip_id",
                "task",
                "reactor",
                "phases",
                "rate_hz",
                "robot_joint_names",
                "robot_root_position",
                "robot_root_quat_wxyz",
                "robot_q",
                "human_joint_names",
                "partner_joints",
                "partner_rotations_wxyz",
                "source_partner_joints",
                "source_partner_rotations_wxyz",
                "source_reactor_joints",
                "source_reactor_rotations_wxyz",
                "reshaped",
                "settings_names",
                "settings_values",
                "tags_names",
                "tags_values",
                "object_position",
                "object_quat_wxyz",
                "object_keypoints"},
               {kLossPrefix});
  const double rate_hz = get_rate(npz);
  const std::vector<int> columns = get_joint_columns(npz);
  PairedMotion motion{.clip_id = get_id(npz, "clip_id"),
                      .task = get_task(npz),
                      .phases = get_phases(npz),
                      .reactor = get_reactor(npz),
                      .robot = get_robot(npz, rate_hz),
                      .partner = get_motion(npz, "partner", rate_hz, columns),
                      .source_partner = get_motion(npz, "source_partner", rate_hz, columns),
                      .source_reactor = get_motion(npz, "source_reactor", rate_hz, columns),
                      .reshaped = {},
                      .loss = {},
                      .settings = get_texts(npz, "settings"),
                      .object = get_object(npz)};
  for (auto& [name, value] : get_texts(npz, "tags")) motion.tags.emplace(name, value);
  if (npz.contains("reshaped")) motion.reshaped = npz.tracks("reshaped", -1);
  for (const std::string& key : npz.keys())
    if (key.starts_with(kLossPrefix)) motion.loss[key.substr(std::string(kLossPrefix).size())] = npz.numbers(key, {-1});
  check_archive(npz, [&] { check_same_time(motion); });
  return motion;
}

void validate(const PairedMotion& motion) {
  const std::string what = fmt::format("paired motion of clip '{}'", motion.clip_id);
  validate(motion.robot, what + ", robot");
  validate(motion.partner, what + ", partner");
  validate(motion.source_partner, what + ", source_partner");
  validate(motion.source_reactor, what + ", source_reactor");
  check_same_time(motion);
}

std::string paired_motion_bytes(const PairedMotion& motion, ZipMethod method) {
  validate(motion);
  Npz npz;
  put_schema(npz, kPairedSchema, kPairedVersion);
  npz.set_text("clip_id", motion.clip_id);
  put_task(npz, motion.task, motion.reactor, motion.phases, motion.robot.rate_hz);
  put_robot(npz, motion.robot);
  put_joint_names(npz);
  put_motion(npz, "partner", motion.partner);
  put_motion(npz, "source_partner", motion.source_partner);
  put_motion(npz, "source_reactor", motion.source_reactor);
  if (!motion.reshaped.empty()) npz.set("reshaped", motion.reshaped);
  for (const auto& [term, values] : motion.loss) npz.set(kLossPrefix + term, values, {values.size()});
  put_texts(npz, "settings", motion.settings);
  put_texts(npz, "tags", {motion.tags.begin(), motion.tags.end()});
  put_object(npz, motion.object);
  return npz.bytes(method);
}

PairedMotion parse_paired_motion(std::string_view bytes, const std::string& name) {
  return read_paired_motion(Npz::parse(bytes, name));
}

void save_paired_motion(const PairedMotion& motion, const std::string& path) {
  write_file(path, paired_motion_bytes(motion));
}

PairedMotion load_paired_motion(const std::string& path) { return read_paired_motion(Npz::load(path)); }

namespace {

void add(const PointTracks& joints, Sha256& digest) {
  std::vector<std::int32_t> tenths;
  tenths.reserve(joints.data().size());
  for (const double x : joints.data()) tenths.push_back(static_cast<std::int32_t>(std::lround(1e4 * x)));
  digest.update(std::string_view(reinterpret_cast<const char*>(tenths.data()), 4 * tenths.size()));
}

}  // namespace

std::string clip_digest(const PairedMotion& motion) {
  Sha256 digest;
  digest.update(std::string(to_string(motion.task)));
  const std::int32_t phases[] = {motion.phases.act_begin, motion.phases.act_end};
  digest.update(std::string_view(reinterpret_cast<const char*>(phases), sizeof phases));
  add(motion.source_partner.joints, digest);
  add(motion.source_reactor.joints, digest);
  if (!motion.object.empty()) add(keypoint_tracks(motion.object), digest);
  return digest.hex();
}

}  // namespace duet
