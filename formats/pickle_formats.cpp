#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <limits>

#include "duet/archives/pickle/pickle_fields.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/require.h"
#include "duet/formats/format_row.h"
#include "duet/formats/motion_source.h"
#include "duet/formats/motion_support.h"
#include "duet/formats/pickle_output.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

bool has_key(const Pickle& pickle, const PickleNode& node, std::string_view key) {
  if (node.kind != PickleKind::kDict) return false;
  for (std::size_t i = 0; i + 1 < node.items.size(); i += 2)
    if (pickle[node.items[i]].kind == PickleKind::kText && pickle[node.items[i]].text == key) return true;
  return false;
}

// ---- GMR

bool is_gmr(const MotionSource& source) {
  return source.pickle && has_key(*source.pickle, (*source.pickle)[source.pickle->root], "root_pos");
}

FileMotion read_gmr(const MotionSource& source, const RobotModel& /*robot*/, const RobotMotionOptions& /*options*/) {
  PickledMotion pickled = motion_of_pickle(*source.pickle);
  FileMotion motion{.path = source.path, .rate_hz = pickled.motion.rate_hz, .q = std::move(pickled.motion.q)};
  for (const Pose& X_WB : pickled.motion.root) {
    motion.position.push_back(X_WB.p);
    motion.quaternion.emplace_back(X_WB.R.coeffs());  // as in the file, which is read as xyzw
  }
  if (!pickled.link_body_list.empty()) {
    motion.bodies = std::move(pickled.local_body_pos);
    motion.bodies_in_base = true;
    motion.body_names = std::move(pickled.link_body_list);
  }
  motion.joint_names = std::move(pickled.motion.joint_names);
  for (const std::string& sentence : pickled.verdict)
    if (sentence.find("renormalised") != std::string::npos || sentence.starts_with(kLeftOutKeys))
      motion.evidence.push_back(sentence);
  return motion;
}

// Positions of the links in the base, as GMR keeps them.
Eigen::MatrixXd positions_in_base(const RobotModel& robot, const RobotMotion& motion, const std::vector<int>& links) {
  Eigen::MatrixXd positions(3 * static_cast<Eigen::Index>(links.size()), motion.frames());
  Kinematics kinematics(robot);
  for (int t = 0; t < motion.frames(); ++t) {
    kinematics.update(Pose(), motion.q.col(t));
    for (std::size_t b = 0; b < links.size(); ++b)
      positions.block<3, 1>(3 * static_cast<Eigen::Index>(b), t) = kinematics.p_WL(links[b]);
  }
  return positions;
}

MotionFiles write_gmr(const RobotMotion& motion, const RobotModel& robot, const RobotMotionWriting& /*writing*/) {
  const auto frames = static_cast<std::size_t>(motion.frames());
  const std::vector<int> links = links_in_order(robot, TreeOrder::kDepthFirst);
  const std::vector<int> joints = joints_in_order(robot, TreeOrder::kDepthFirst);
  PickleOutput out;
  out.begin_dict();
  out.key("fps").rate(motion.rate_hz);
  out.key("root_pos").array({frames, 3}, root_positions(motion));
  out.key("root_rot").array({frames, 4}, root_quaternions(motion, QuaternionOrder::kXyzw));
  out.key("dof_pos").array({frames, joints.size()}, rows_of(motion.q, joints));
  out.key("local_body_pos").array({frames, links.size(), 3}, positions_in_base(robot, motion, links));
  out.key("link_body_list").texts(link_names(robot, links));
  return {{"", out.end_dict().finish()}};
}

// ---- PHC: a dict of motions by name

const PickleNode* first_motion(const Pickle& pickle) {
  const PickleNode& root = pickle[pickle.root];
  if (root.kind != PickleKind::kDict || root.items.size() < 2) return nullptr;
  return &pickle[root.items[1]];
}

bool is_phc(const MotionSource& source) {
  if (!source.pickle) return false;
  const PickleNode* motion = first_motion(*source.pickle);
  return motion != nullptr && has_key(*source.pickle, *motion, "root_trans_offset");
}

const PickleNode& chosen_motion(const Pickle& pickle, const std::string& name) {
  const PickleDict library(pickle, pickle[pickle.root]);
  const std::vector<std::string> names = library.keys();
  if (name.empty() && names.size() != 1)
    throw InputError(fmt::format("'{}': holds {} motions, name one of them: {}", pickle.name, names.size(),
                                 excerpt(fmt::format("{}", fmt::join(names, ", ")), kShownSentence)));
  return library.get(name.empty() ? names.front() : name);
}

// (T, n) or (T, n, 1).
PickleTable joint_table(const Pickle& pickle, const PickleNode& node, std::size_t frames) {
  const std::size_t dimensions = pickle_numbers(pickle, node, "key 'dof'").shape.size();
  if (dimensions == 3) return pickle_table(pickle, node, "dof", frames, {0, 1});
  return pickle_table(pickle, node, "dof", frames, {0});
}

// Tells the order of root_rot by pose_aa, whose first joint is the root's rotation vector.
void compare_root(const Pickle& pickle, const PickleDict& dict, FileMotion& motion) {
  const PickleNode* node = dict.find("pose_aa");
  if (node == nullptr || node->shape.size() != 3) return;
  const PickleTable pose = pickle_table(pickle, *node, "pose_aa", motion.position.size(), {0, 3});
  double xyzw = 0.0, wxyz = 0.0;
  for (std::size_t t = 0; t < pose.rows; ++t) {
    const Eigen::Vector3d turn = Eigen::Map<const Eigen::Vector3d>(&pose.values[t * pose.row_size]);
    const Eigen::Quaterniond R(Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()));
    const Eigen::Vector4d& c = motion.quaternion[t];
    xyzw += R.angularDistance(Eigen::Quaterniond(c[3], c[0], c[1], c[2]).normalized());
    wxyz += R.angularDistance(Eigen::Quaterniond(c[0], c[1], c[2], c[3]).normalized());
  }
  const auto frames = static_cast<double>(pose.rows);
  motion.quaternion_witness = xyzw <= wxyz ? QuaternionOrder::kXyzw : QuaternionOrder::kWxyz;
  motion.evidence.push_back(
      fmt::format("pose_aa: its root is {:.3g} rad from root_rot as xyzw, {:.3g} rad as wxyz (mean)", xyzw / frames,
                  wxyz / frames));
}

FileMotion read_phc(const MotionSource& source, const RobotModel& /*robot*/, const RobotMotionOptions& options) {
  const Pickle& pickle = *source.pickle;
  const PickleDict dict(pickle, chosen_motion(pickle, options.motion));
  const PickleTable position = pickle_table(pickle, dict.get("root_trans_offset"), "root_trans_offset", 0, {3});
  const PickleTable rotation = pickle_table(pickle, dict.get("root_rot"), "root_rot", position.rows, {4});
  const PickleTable joints = joint_table(pickle, dict.get("dof"), position.rows);
  FileMotion motion{.path = source.path,
                    .position = vectors_of(position.values),
                    .quaternion = quaternions_of(rotation.values),
                    .q = columns_of(joints.values, joints.row_size)};
  if (const PickleNode* fps = dict.find("fps")) motion.rate_hz = pickle_rate(pickle, *fps);
  compare_root(pickle, dict, motion);
  return motion;
}

// The root's rotation vector, then each joint's axis times its angle. (3 (1 + n), T)
Eigen::MatrixXd pose_vectors(const RobotModel& robot, const RobotMotion& motion, const std::vector<int>& joints) {
  Eigen::MatrixXd pose(3 + 3 * static_cast<Eigen::Index>(joints.size()), motion.frames());
  for (int t = 0; t < motion.frames(); ++t) {
    pose.col(t).head<3>() = rotation_vector(motion.root[static_cast<std::size_t>(t)].R);
    for (std::size_t j = 0; j < joints.size(); ++j)
      pose.block<3, 1>(3 + 3 * static_cast<Eigen::Index>(j), t) =
          robot.links[static_cast<std::size_t>(joints[j]) + 1].axis * motion.q(joints[j], t);
  }
  return pose;
}

MotionFiles write_phc(const RobotMotion& motion, const RobotModel& robot, const RobotMotionWriting& writing) {
  const auto frames = static_cast<std::size_t>(motion.frames());
  const std::vector<int> joints = joints_in_order(robot, TreeOrder::kDepthFirst);
  PickleOutput out;
  out.begin_dict().key(writing.name).begin_dict();
  out.key("root_trans_offset").array({frames, 3}, root_positions(motion));
  out.key("pose_aa").array({frames, joints.size() + 1, 3}, pose_vectors(robot, motion, joints));
  out.key("dof").array({frames, joints.size()}, rows_of(motion.q, joints));
  out.key("root_rot").array({frames, 4}, root_quaternions(motion, QuaternionOrder::kXyzw));
  out.key("fps").rate(motion.rate_hz);
  return {{"", out.end_dict().end_dict().finish()}};
}

}  // namespace

std::vector<RobotMotionFormat> pickle_formats() {
  return {
      {.name = "gmr",
       .about = "GMR, TWIST, TWIST2; GMT's 23 joints",
       .holds = "pickled dict: fps, root_pos (T, 3), root_rot (T, 4), dof_pos (T, n), local_body_pos (None or "
                "(T, B, 3), in the base), link_body_list (None or names)",
       .evidence = "YanjieZe/GMR scripts/bvh_to_robot.py; six files of TWIST2 and GMT",
       .licence = "MIT (GMR, TWIST2), Apache-2.0 (GMT)",
       .ending = ".pkl",
       .container = MotionContainer::kPickle,
       .layout = {.quaternion = QuaternionOrder::kXyzw},
       .recognises = is_gmr,
       .read = read_gmr,
       .write = write_gmr},
      {.name = "phc",
       .about = "PHC, ASAP, PBHC and SONIC motion libraries; of several motions one is named",
       .holds = "pickled dict of dicts by name: root_trans_offset (T, 3), pose_aa (T, 1 + n, 3), dof (T, n), root_rot "
                "(T, 4), fps",
       .evidence = "ZhengyiLuo/PHC fit_smpl_motion.py; LeCAR-Lab/ASAP; SONIC's conventions.md has root_rot as wxyz",
       .licence = "BSD-3-Clause (PHC), MIT (ASAP)",
       .ending = ".pkl",
       .container = MotionContainer::kPickle,
       .layout = {.quaternion = QuaternionOrder::kXyzw, .rate_hz = 30.0},
       .recognises = is_phc,
       .read = read_phc,
       .write = write_phc},
  };
}

namespace {

// Opcodes of protocol 4 (PEP 307, PEP 3154; Python's Lib/pickletools.py).
constexpr std::string_view kProtocol = "\x80\x04", kStop = ".", kEmptyDict = "}", kEmptyList = "]", kMark = "(",
                           kSetItems = "u", kAppends = "e", kTuple = "t", kReduce = "R", kBuild = "b", kNone = "N",
                           kTrue = "\x88", kFalse = "\x89", kTuple1 = "\x85", kTuple3 = "\x87", kGlobal = "\x93",
                           kText = "X", kBytes = "B", kBytes8 = "\x8e", kFloat = "G", kInt = "J", kLong = "\x8a\x08";

}  // namespace

PickleOutput::PickleOutput() : out_(kProtocol) {}

PickleOutput& PickleOutput::begin_dict() {
  out_ += kEmptyDict;
  out_ += kMark;
  return *this;
}

PickleOutput& PickleOutput::end_dict() {
  out_ += kSetItems;
  return *this;
}

PickleOutput& PickleOutput::little(std::uint64_t value, int size) {
  for (int i = 0; i < size; ++i) out_ += static_cast<char>(value >> (8 * i) & 0xff);
  return *this;
}

PickleOutput& PickleOutput::text(std::string_view value) {
  out_ += kText;
  little(value.size(), 4);
  out_ += value;
  return *this;
}

PickleOutput& PickleOutput::real(double value) {
  out_ += kFloat;
  const auto bits = std::bit_cast<std::uint64_t>(value);
  for (int i = 7; i >= 0; --i) out_ += static_cast<char>(bits >> (8 * i) & 0xff);
  return *this;
}

PickleOutput& PickleOutput::rate(double rate_hz) {
  return is_whole(rate_hz) ? integer(static_cast<std::int64_t>(rate_hz)) : real(rate_hz);
}

PickleOutput& PickleOutput::integer(std::int64_t value) {
  const bool small =
      value >= std::numeric_limits<std::int32_t>::min() && value <= std::numeric_limits<std::int32_t>::max();
  out_ += small ? kInt : kLong;
  return little(static_cast<std::uint64_t>(value), small ? 4 : 8);
}

PickleOutput& PickleOutput::texts(std::span<const std::string> values) {
  out_ += kEmptyList;
  out_ += kMark;
  for (const std::string& value : values) text(value);
  out_ += kAppends;
  return *this;
}

PickleOutput& PickleOutput::call(std::string_view module, std::string_view name) {
  text(module).text(name);
  out_ += kGlobal;
  return *this;
}

PickleOutput& PickleOutput::bytes(std::string_view value) {
  const bool large = value.size() > std::numeric_limits<std::uint32_t>::max();
  out_ += large ? kBytes8 : kBytes;
  little(value.size(), large ? 8 : 4);
  out_ += value;
  return *this;
}

PickleOutput& PickleOutput::array(const std::vector<std::size_t>& shape, std::span<const double> values) {
  std::size_t count = 1;
  for (const std::size_t size : shape) count *= size;
  require(count == values.size(), "a pickled array: shape and number of values disagree");
  static_assert(std::endian::native == std::endian::little);
  // _reconstruct(ndarray, (0,), b"b"), then its state: (1, shape, dtype, False, bytes).
  call("numpy.core.multiarray", "_reconstruct").call("numpy", "ndarray").integer(0);
  out_ += kTuple1;
  bytes("b");
  out_.append(kTuple3).append(kReduce).append(kMark);
  integer(1);
  out_ += kMark;
  for (const std::size_t size : shape) integer(static_cast<std::int64_t>(size));
  out_ += kTuple;
  // dtype("f8", False, True), then its state: (3, "<", None, None, None, -1, -1, 0).
  call("numpy", "dtype").text("f8");
  out_.append(kFalse).append(kTrue).append(kTuple3).append(kReduce).append(kMark);
  integer(3).text("<");
  out_.append(kNone).append(kNone).append(kNone);
  integer(-1).integer(-1).integer(0);
  out_.append(kTuple).append(kBuild).append(kFalse);
  bytes({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double)});
  out_.append(kTuple).append(kBuild);
  return *this;
}

std::string PickleOutput::finish() {
  out_ += kStop;
  return std::move(out_);
}

}  // namespace duet
