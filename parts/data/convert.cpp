#include "duet/parts/data/convert.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "duet/core/naming_file.h"
#include "duet/core/require.h"
#include "duet/motion/paired_motion.h"
#include "duet/retarget/sim_to_real.h"

namespace duet {
namespace {

constexpr const char* kPaired = "paired";

std::string ending_of(const std::string& to) { return to == kPaired ? ".npz" : robot_motion_format(to).ending; }

ConvertedMotion write_resampled(const RobotMotion& motion, const std::string& output, const RobotModel& robot,
                                const RobotMotionFormat& format, RobotMotionWriting writing,
                                std::vector<std::string> evidence) {
  const double rate_hz = written_rate(format, motion.rate_hz, writing);
  writing.rate_hz = rate_hz;
  if (rate_hz == motion.rate_hz) {
    write_robot_motion(motion, robot, format, output, writing);
    return {output, motion.frames(), rate_hz, std::move(evidence)};
  }
  const RobotMotion resampled = resample(motion, rate_hz);
  evidence.push_back(fmt::format("resampled: {} frames at {:.4g} Hz -> {} frames at {:g} Hz", motion.frames(),
                                 motion.rate_hz, resampled.frames(), rate_hz));
  write_robot_motion(resampled, robot, format, output, writing);
  return {output, resampled.frames(), rate_hz, std::move(evidence)};
}

// A paired motion that is prepared, asked to stay one, or both.
ConvertedMotion convert_paired(const MotionSource& source, const std::string& output, const RobotModel& robot,
                               const ConversionOptions& options) {
  require(robot_motion_format(kPaired).recognises(source), "'{}': expected a paired motion (`duet retarget`) {}",
          source.path, options.sim_to_real ? "to prepare for the real robot" : "to write one");
  PairedMotion motion = read_paired_motion(*source.npz);
  std::vector<std::string> evidence = {
      "format: paired (by its content): the robot of a paired motion (`duet retarget`)"};
  if (options.sim_to_real) {
    motion = prepare_for_real(std::move(motion), robot);
    evidence.push_back(fmt::format("prepared for the real robot (Algorithm 7): act [{}, {}) is unchanged",
                                   motion.phases.act_begin, motion.phases.act_end));
  }
  if (options.to == kPaired) {
    save_paired_motion(motion, output);
    return {output, motion.frames(), motion.robot.rate_hz, evidence};
  }
  const RobotMotionFormat& format = robot_motion_format(options.to);
  evidence.emplace_back("the partner stays behind: robot motions hold no person");
  if (!motion.object.empty()) evidence.emplace_back("the object stays behind: robot motions hold none");
  return write_resampled(motion.robot, output, robot, format, options.writing, std::move(evidence));
}

bool has_known_ending(const std::filesystem::path& path) {
  const std::span<const RobotMotionFormat> formats = robot_motion_formats();
  return std::any_of(formats.begin(), formats.end(), [&](const RobotMotionFormat& format) {
    return *format.ending != '\0' && path.extension() == format.ending;
  });
}

bool is_motion_folder(const std::filesystem::path& path) {
  return std::filesystem::is_regular_file(path / "joint_pos.csv");  // SONIC's
}

void search(const std::filesystem::path& folder, std::vector<std::string>& found) {
  if (is_motion_folder(folder)) {
    found.push_back(folder.string());
    return;
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_symlink()) continue;
    if (entry.is_directory()) search(entry.path(), found);
    if (entry.is_regular_file() && has_known_ending(entry.path())) found.push_back(entry.path().string());
  }
}

}  // namespace

ConvertedMotion convert_motion(const std::string& input, const std::string& output, const RobotModel& robot,
                               const ConversionOptions& options) {
  const MotionSource source = open_motion_source(input);
  if (options.sim_to_real || options.to == kPaired)
    return naming_file(input, [&] { return convert_paired(source, output, robot, options); });
  const RobotMotionFormat& format = robot_motion_format(options.to);
  RobotMotionFile read = read_robot_motion(source, robot, options.reading, options.from);
  if (read.format == kPaired) read.evidence.emplace_back("the partner stays behind: robot motions hold no person");
  RobotMotionWriting writing = options.writing;
  writing.name = std::filesystem::path(input).stem().string();
  return write_resampled(read.motion, output, robot, format, writing, std::move(read.evidence));
}

std::vector<std::string> find_robot_motions(const std::vector<std::string>& paths) {
  std::vector<std::string> found;
  for (const std::string& path : paths) {
    const std::size_t before = found.size();
    if (std::filesystem::is_directory(path))
      search(path, found);
    else if (std::filesystem::exists(path))
      found.push_back(path);
    else
      throw InputError(fmt::format("cannot read '{}': No such file or directory", path));
    if (found.size() == before) throw InputError(fmt::format("'{}': expected robot motions, found none", path));
    std::sort(found.begin() + static_cast<std::ptrdiff_t>(before), found.end());
  }
  return found;
}

std::vector<std::string> converted_paths(const std::vector<std::string>& inputs, const std::string& output,
                                         const std::string& to) {
  const std::string ending = ending_of(to);
  const std::filesystem::path folder(output);
  const bool named = ending.empty() ? !std::filesystem::is_directory(folder) : folder.extension() == ending;
  if (inputs.size() == 1 && named) return {output};
  std::vector<std::string> paths;
  std::set<std::string> taken;
  for (const std::string& input : inputs) {
    const std::filesystem::path file(input);
    const std::filesystem::path name = file.has_filename() ? file.stem() : file.parent_path().stem();
    paths.push_back((folder / (name.string() + ending)).string());
    require(taken.insert(paths.back()).second, "'{}': another input would be written to '{}' too", input, paths.back());
  }
  return paths;
}

}  // namespace duet
