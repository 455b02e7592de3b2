#include "duet/formats/robot_motion_format.h"

#include <fmt/format.h>

#include <filesystem>

#include "duet/core/file_batch.h"
#include "duet/core/named_table.h"
#include "duet/core/require.h"
#include "duet/formats/format_row.h"
#include "duet/robots/robot_model.h"

namespace duet {
namespace {

std::vector<RobotMotionFormat> all_formats() {
  std::vector<RobotMotionFormat> formats;
  for (const auto& part : {pickle_formats(), tracking_formats(), qpos_formats(), table_formats()})
    formats.insert(formats.end(), part.begin(), part.end());
  return formats;
}

const RobotMotionFormat& format_of(const MotionSource& source, const std::string& name) {
  if (!name.empty()) {
    const RobotMotionFormat& format = robot_motion_format(name);
    if (format.container != source.container)
      throw InputError(fmt::format("'{}': format '{}' is {}, found {}", source.path, name, to_string(format.container),
                                   to_string(source.container)));
    return format;
  }
  for (const RobotMotionFormat& format : robot_motion_formats())
    if (format.recognises(source)) return format;
  std::vector<std::string> known;
  for (const RobotMotionFormat& format : robot_motion_formats())
    if (format.container == source.container) known.push_back(fmt::format("{} ({})", format.name, format.holds));
  throw InputError(fmt::format("'{}': {} of none of the known robot motions: {}", source.path,
                               to_string(source.container), fmt::join(known, "; ")));
}

void require_writable(const RobotMotion& motion, const RobotModel& robot, const RobotMotionFormat& format) {
  require(format.write != nullptr, "format '{}' is read, not written", format.name);
  require(motion.joint_names == robot.joint_names(),
          "format '{}': expected the joints of robot '{}' in its order, found {}", format.name, robot.name,
          fmt::join(motion.joint_names, ", "));
  validate(motion, fmt::format("motion to be written as '{}'", format.name));
}

}  // namespace

std::span<const RobotMotionFormat> robot_motion_formats() {
  static const std::vector<RobotMotionFormat> formats = all_formats();
  return formats;
}

std::vector<std::string> robot_motion_format_names() { return names_of(robot_motion_formats()); }

const RobotMotionFormat& robot_motion_format(std::string_view name) {
  return entry_named(robot_motion_formats(), "robot motion format", name);
}

namespace {

// A file's root is the URDF's origin; of a robot whose base's frame is elsewhere it is moved there and back. [m], in B
void move_root(RobotMotion& motion, const Eigen::Vector3d& by) {
  for (Pose& X_WB : motion.root) X_WB.p += X_WB.R * by;
}

}  // namespace

RobotMotionFile read_robot_motion(const MotionSource& source, const RobotModel& robot,
                                  const RobotMotionOptions& options, const std::string& format) {
  if (const Eigen::Vector3d p_BU = urdf_origin(robot); !p_BU.isZero(0.0)) {
    RobotMotionFile file = read_robot_motion(source, with_origin_at(robot, p_BU), options, format);
    move_root(file.motion, -p_BU);
    return file;
  }
  const RobotMotionFormat& row = format_of(source, format);
  RobotMotionFile file = interpret(row.read(source, robot, options), row.layout, robot, options);
  file.format = row.name;
  file.evidence.insert(file.evidence.begin(), fmt::format("format: {} ({}): {}", row.name,
                                                          format.empty() ? "by its content" : "as told", row.about));
  return file;
}

RobotMotionFile read_robot_motion(const std::string& path, const RobotModel& robot, const RobotMotionOptions& options,
                                  const std::string& format) {
  return read_robot_motion(open_motion_source(path), robot, options, format);
}

double written_rate(const RobotMotionFormat& format, double rate_hz, const RobotMotionWriting& writing) {
  if (writing.rate_hz) return *writing.rate_hz;
  return format.holds_rate || format.layout.rate_hz == 0.0 ? rate_hz : format.layout.rate_hz;
}

MotionFiles robot_motion_files(const RobotMotion& motion, const RobotModel& robot, const RobotMotionFormat& format,
                               const RobotMotionWriting& writing) {
  if (const Eigen::Vector3d p_BU = urdf_origin(robot); !p_BU.isZero(0.0)) {
    RobotMotion moved = motion;
    move_root(moved, p_BU);
    return robot_motion_files(moved, with_origin_at(robot, p_BU), format, writing);
  }
  require_writable(motion, robot, format);
  const double rate_hz = written_rate(format, motion.rate_hz, writing);
  require(rate_hz >= kLowestRate && rate_hz <= kHighestRate, "format '{}': expected a rate of {} to {} Hz, found {}",
          format.name, kLowestRate, kHighestRate, rate_hz);
  const RobotMotion written = rate_hz == motion.rate_hz ? motion : resample(motion, rate_hz);
  require(written.frames() >= 2, "format '{}': expected at least 2 frames at {} Hz, found {}", format.name, rate_hz,
          written.frames());
  return format.write(written, robot, writing);
}

void write_robot_motion(const RobotMotion& motion, const RobotModel& robot, const RobotMotionFormat& format,
                        const std::string& path, const RobotMotionWriting& writing) {
  const MotionFiles files = robot_motion_files(motion, robot, format, writing);
  FileBatch batch;
  for (const auto& [name, content] : files)
    batch.write(name.empty() ? path : fmt::format("{}/{}", path, name), content);
  batch.put_in_place();
}

std::string documented_layout(const RobotMotionFormat& format) {
  const MotionLayout& layout = format.layout;
  return fmt::format("{}, {}, {}, {}; {}", layout.turns ? "turns xyz" : to_string(layout.quaternion),
                     to_string(layout.joints), to_string(layout.angles),
                     layout.metres == 1.0 ? "m" : fmt::format("{:g} m", layout.metres),
                     layout.rate_hz == 0.0 ? "rate inside"
                     : format.holds_rate   ? fmt::format("rate inside, else {:g} Hz", layout.rate_hz)
                                           : fmt::format("{:g} Hz", layout.rate_hz));
}

}  // namespace duet
