#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string_view>

#include "duet/core/require.h"
#include "duet/formats/format_row.h"
#include "duet/formats/motion_source.h"
#include "duet/formats/motion_support.h"

namespace duet {
namespace {

// ---- BeyondMimic and holosoma share their keys; holosoma's joint_pos begins with the root's pose.

std::size_t width_of(const Npz& npz, const std::string& key) {
  const std::vector<std::size_t>& shape = npz.array(key).shape;
  return shape.size() == 2 ? shape[1] : 0;
}

std::size_t length_of(const Npz& npz, const std::string& key) {
  const std::vector<std::size_t>& shape = npz.array(key).shape;
  return shape.size() == 1 ? shape[0] : 0;
}

bool has_bodies(const MotionSource& source) { return source.has("joint_pos") && source.has("body_pos_w"); }

bool is_holosoma(const MotionSource& source) {
  return has_bodies(source) && source.has("joint_names") &&
         width_of(*source.npz, "joint_pos") == length_of(*source.npz, "joint_names") + 7;
}

bool is_beyondmimic(const MotionSource& source) { return has_bodies(source) && !is_holosoma(source); }

void put_rate(Npz& npz, double rate_hz) {
  if (is_whole(rate_hz))
    npz.set("fps", std::vector<std::int64_t>{static_cast<std::int64_t>(rate_hz)}, {1});
  else
    npz.set("fps", std::vector<double>{rate_hz}, {1});
}

void put_bodies(Npz& npz, const LinkMotion& bodies) {
  put_rows(npz, "body_pos_w", bodies.position, 3);
  put_rows(npz, "body_quat_w", bodies.quat_wxyz, 4);
  put_rows(npz, "body_lin_vel_w", bodies.velocity, 3);
  put_rows(npz, "body_ang_vel_w", bodies.angular_velocity, 3);
}

// The base is the first body in either order.
FileMotion read_beyondmimic(const MotionSource& source, const RobotModel& /*robot*/,
                            const RobotMotionOptions& /*options*/) {
  const Npz& npz = *source.npz;
  FileMotion motion{.path = source.path,
                    .q = columns_of(npz.numbers("joint_pos", {-1, -1}), width_of(npz, "joint_pos"))};
  const auto frames = static_cast<long>(motion.q.cols());
  motion.bodies = npz.tracks("body_pos_w", -1);
  const std::vector<double> quat = npz.numbers("body_quat_w", {frames, motion.bodies.points(), 4});
  if (motion.bodies.frames() != frames || motion.bodies.points() == 0)
    throw InputError(fmt::format("'{}': array 'body_pos_w': expected shape ({}, bodies, 3), found ({}, {}, 3)",
                                 source.path, frames, motion.bodies.frames(), motion.bodies.points()));
  const std::size_t row = 4 * static_cast<std::size_t>(motion.bodies.points());
  for (int t = 0; t < motion.bodies.frames(); ++t) {
    motion.position.emplace_back(motion.bodies.at(t, 0));
    motion.quaternion.emplace_back(Eigen::Map<const Eigen::Vector4d>(&quat[static_cast<std::size_t>(t) * row]));
  }
  if (source.has("fps")) motion.rate_hz = npz.number_or_text("fps");
  if (source.has("joint_names")) motion.joint_names = npz.strings("joint_names", {-1});
  if (source.has("body_names")) motion.body_names = npz.strings("body_names", {-1});
  return motion;
}

MotionFiles write_beyondmimic(const RobotMotion& motion, const RobotModel& robot, const RobotMotionWriting& writing) {
  const std::vector<int> joints = joints_in_order(robot, writing.order), links = links_in_order(robot, writing.order);
  const Eigen::MatrixXd q = rows_of(motion.q, joints);
  Npz npz;
  put_rate(npz, motion.rate_hz);
  put_rows(npz, "joint_pos", q);
  put_rows(npz, "joint_vel", rate_of_change(q, motion.rate_hz));
  put_bodies(npz, link_motion(robot, motion, links));
  npz.set("joint_names", joint_names(robot, joints));
  npz.set("body_names", link_names(robot, links));
  npz.set_text("order", std::string(to_string(writing.order)));
  return {{"", npz.bytes()}};
}

FileMotion read_holosoma(const MotionSource& source, const RobotModel& /*robot*/,
                         const RobotMotionOptions& /*options*/) {
  const Npz& npz = *source.npz;
  FileMotion motion{.path = source.path, .joint_names = npz.strings("joint_names", {-1})};
  const auto joints = static_cast<Eigen::Index>(motion.joint_names.size());
  take_qpos(columns_of(npz.numbers("joint_pos", {-1, joints + 7}), static_cast<std::size_t>(joints) + 7), joints,
            motion);
  if (source.has("fps")) motion.rate_hz = npz.number_or_text("fps");
  if (source.has("body_names")) {
    motion.body_names = npz.strings("body_names", {-1});
    motion.bodies = npz.tracks("body_pos_w", static_cast<int>(motion.body_names.size()));
  }
  if (source.has("object_pos_w")) motion.evidence.emplace_back("an object moves in the file: left out");
  return motion;
}

// MuJoCo's bodies begin with the world, which stands still.
LinkMotion below_world(const LinkMotion& bodies) {
  const Eigen::Index frames = bodies.position.cols();
  const Eigen::MatrixXd zero = Eigen::MatrixXd::Zero(3, frames);
  Eigen::MatrixXd identity = Eigen::MatrixXd::Zero(4, frames);
  identity.row(0).setOnes();
  return {.position = stacked(zero, bodies.position),
          .quat_wxyz = stacked(identity, bodies.quat_wxyz),
          .velocity = stacked(zero, bodies.velocity),
          .angular_velocity = stacked(zero, bodies.angular_velocity)};
}

MotionFiles write_holosoma(const RobotMotion& motion, const RobotModel& robot, const RobotMotionWriting& /*writing*/) {
  const std::vector<int> joints = joints_in_order(robot, TreeOrder::kDepthFirst);
  const std::vector<int> links = links_in_order(robot, TreeOrder::kDepthFirst);
  const LinkMotion bodies = link_motion(robot, motion, links);
  const Eigen::MatrixXd q = rows_of(motion.q, joints);
  Npz npz;
  put_rate(npz, motion.rate_hz);
  put_rows(npz, "joint_pos",
           stacked(stacked(root_positions(motion), root_quaternions(motion, QuaternionOrder::kWxyz)), q));
  put_rows(npz, "joint_vel",
           stacked(stacked(bodies.velocity.topRows<3>(), bodies.angular_velocity.topRows<3>()),
                   rate_of_change(q, motion.rate_hz)));
  put_bodies(npz, below_world(bodies));
  std::vector<std::string> names = link_names(robot, links);
  names.insert(names.begin(), "world");
  npz.set("joint_names", joint_names(robot, joints));
  npz.set("body_names", names);
  return {{"", npz.bytes()}};
}

// ---- SONIC: a folder

const std::string* find_text(const MotionSource& source, const std::string& name) {
  const auto found = source.files.find(name);
  return found == source.files.end() ? nullptr : &found->second;
}

bool is_sonic(const MotionSource& source) {
  return source.container == MotionContainer::kFolder && find_text(source, "joint_pos.csv") != nullptr;
}

CsvTable get_table(const MotionSource& source, const std::string& name) {
  const std::string* text = find_text(source, name);
  if (text == nullptr) throw InputError(fmt::format("'{}': expected the file '{}' in the folder", source.path, name));
  return parse_csv_table(*text, source.path + "/" + name);
}

// "Body part indexes:" and on the next line "[0 4 10]", with blanks or commas.
std::vector<int> body_numbers(const MotionSource& source) {
  const std::string* text = find_text(source, "metadata.txt");
  if (text == nullptr) return {0};
  const std::size_t label = text->find("Body part indexes");
  const std::size_t begin = label == std::string::npos ? label : text->find('[', label);
  const std::size_t end = begin == std::string::npos ? begin : text->find(']', begin);
  if (end == std::string::npos)
    throw InputError(fmt::format("'{}/metadata.txt': expected 'Body part indexes: [...]'", source.path));
  std::vector<int> numbers;
  std::string_view list(*text);
  list = list.substr(begin + 1, end - begin - 1);
  constexpr std::string_view kBetween = " ,\t\r\n";
  constexpr double kMostBodies = 10'000;
  for (std::size_t at = list.find_first_not_of(kBetween); at != std::string_view::npos;) {
    const std::size_t stop = std::min(list.find_first_of(kBetween, at), list.size());
    const std::string_view word = list.substr(at, stop - at);
    const std::optional<double> number = parse_number(word);
    if (!number || *number < 0.0 || *number > kMostBodies || *number != std::floor(*number))
      throw InputError(
          fmt::format("'{}/metadata.txt': body part indexes: expected a whole number of 0 or more, found "
                      "'{}'",
                      source.path, excerpt(word)));
    numbers.push_back(static_cast<int>(*number));
    at = list.find_first_not_of(kBetween, stop);
  }
  return numbers;
}

// Root-only folders are as good as those with several bodies; the base must be among them.
FileMotion read_sonic(const MotionSource& source, const RobotModel& /*robot*/, const RobotMotionOptions& /*options*/) {
  const CsvTable joints = get_table(source, "joint_pos.csv"), places = get_table(source, "body_pos.csv");
  const CsvTable turns = get_table(source, "body_quat.csv");
  const std::vector<int> bodies = body_numbers(source);
  const auto base = std::find(bodies.begin(), bodies.end(), 0) - bodies.begin();
  const auto count = static_cast<Eigen::Index>(bodies.size());
  if (base == count) throw InputError(fmt::format("'{}': expected the base (index 0) among the bodies", source.path));
  if (places.values.rows() != 3 * count || turns.values.rows() != 4 * count)
    throw InputError(
        fmt::format("'{}': expected {} columns of positions and {} of quaternions for {} bodies, found {} "
                    "and {}",
                    source.path, 3 * count, 4 * count, count, places.values.rows(), turns.values.rows()));
  if (places.rows() != joints.rows() || turns.rows() != joints.rows())
    throw InputError(
        fmt::format("'{}': expected {} frames as in joint_pos.csv, found {} in body_pos.csv, {} in "
                    "body_quat.csv",
                    source.path, joints.rows(), places.rows(), turns.rows()));
  FileMotion motion{.path = source.path, .q = joints.values};
  for (int t = 0; t < joints.rows(); ++t) {
    motion.position.emplace_back(places.values.col(t).segment<3>(3 * base));
    motion.quaternion.emplace_back(turns.values.col(t).segment<4>(4 * base));
  }
  motion.bodies = PointTracks(joints.rows(), static_cast<int>(count),
                              {places.values.data(), places.values.data() + places.values.size()});
  motion.body_numbers = bodies;
  return motion;
}

std::vector<std::string> numbered(const std::string& begin, std::size_t count, const std::string& end,
                                  std::string_view axes) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string name = fmt::format("{}{}{}", begin, i, end);
    if (axes.empty()) names.push_back(name);
    for (const char axis : axes) names.push_back(fmt::format("{}_{}", name, axis));
  }
  return names;
}

MotionFiles write_sonic(const RobotMotion& motion, const RobotModel& robot, const RobotMotionWriting& writing) {
  const std::vector<int> joints = joints_in_order(robot, TreeOrder::kBreadthFirst);
  const std::vector<int> links = links_in_order(robot, TreeOrder::kBreadthFirst);
  const Eigen::MatrixXd q = rows_of(motion.q, joints);
  const LinkMotion bodies = link_motion(robot, motion, links);
  std::vector<int> numbers(links.size());
  std::iota(numbers.begin(), numbers.end(), 0);
  const std::size_t b = links.size();
  return {
      {"joint_pos.csv", csv_text(numbered("joint_", joints.size(), "", ""), q)},
      {"joint_vel.csv", csv_text(numbered("joint_vel_", joints.size(), "", ""), rate_of_change(q, motion.rate_hz))},
      {"body_pos.csv", csv_text(numbered("body_", b, "", "xyz"), bodies.position)},
      {"body_quat.csv", csv_text(numbered("body_", b, "", "wxyz"), bodies.quat_wxyz)},
      {"body_lin_vel.csv", csv_text(numbered("body_", b, "_vel", "xyz"), bodies.velocity)},
      {"body_ang_vel.csv", csv_text(numbered("body_", b, "_angvel", "xyz"), bodies.angular_velocity)},
      {"metadata.txt", fmt::format("Metadata for: {}\n==============================\n\nBody part indexes:\n[{}]\n\n"
                                   "Total timesteps: {}\n",
                                   writing.name, fmt::join(numbers, " "), motion.frames())}};
}

}  // namespace

std::vector<RobotMotionFormat> tracking_formats() {
  return {
      {.name = "beyondmimic",
       .about = "BeyondMimic and its forks; joints and bodies breadth-first for IsaacLab, depth-first for mjlab",
       .holds = "NPZ: fps (1,), joint_pos and joint_vel (T, n), body_pos_w, body_lin_vel_w, body_ang_vel_w (T, B, 3), "
                "body_quat_w (T, B, 4); the base is body 0. Written also: joint_names, body_names, order",
       .evidence = "HybridRobotics/whole_body_tracking scripts/csv_to_npz.py; mjlab PR 781 (orders)",
       .licence = "MIT",
       .ending = ".npz",
       .container = MotionContainer::kNpz,
       .layout = {.quaternion = QuaternionOrder::kWxyz, .joints = TreeOrder::kBreadthFirst, .rate_hz = 50.0},
       .recognises = is_beyondmimic,
       .read = read_beyondmimic,
       .write = write_beyondmimic},
      {.name = "holosoma",
       .about = "holosoma's tracking motions; objects are left out",
       .holds = "NPZ: as BeyondMimic, but joint_pos (T, 7 + n) begins with the root's pose and joint_vel (T, 6 + n) "
                "with its velocities in W; joint_names (n,), body_names (B,) with world first",
       .evidence = "amazon-far/holosoma convert_data_format_mj.py; one of its files",
       .licence = "Apache-2.0",
       .ending = ".npz",
       .container = MotionContainer::kNpz,
       .layout = {.quaternion = QuaternionOrder::kWxyz, .rate_hz = 50.0},
       .recognises = is_holosoma,
       .read = read_holosoma,
       .write = write_holosoma},
      {.name = "sonic",
       .about = "SONIC reference motions (GR00T whole-body control), a folder of tables",
       .holds = "joint_pos.csv, joint_vel.csv (n columns, named), body_pos.csv (3 a body), body_quat.csv (4 a body), "
                "metadata.txt with the bodies' places in the order; body_lin_vel.csv, body_ang_vel.csv",
       .evidence = "\"Motion Reference Data\" of GR00T-WholeBodyControl's documentation",
       .licence = "Apache-2.0",
       .ending = "",
       .container = MotionContainer::kFolder,
       .layout = {.quaternion = QuaternionOrder::kWxyz, .joints = TreeOrder::kBreadthFirst, .rate_hz = 50.0},
       .holds_rate = false,
       .recognises = is_sonic,
       .read = read_sonic,
       .write = write_sonic},
  };
}

}  // namespace duet
