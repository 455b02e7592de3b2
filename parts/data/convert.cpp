#include "duet/parts/data/convert.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/motion/paired_motion.h"
#include "duet/parts/data/import.h"
#include "duet/parts/data/part.h"
#include "duet/retarget/solver/pair.h"

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
    return with_file_context(input, [&] { return convert_paired(source, output, robot, options); });
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

namespace duet::cli {

// duet convert: robot motions from any of the known formats into another.

namespace {

struct ConvertArguments {
  std::vector<std::string> inputs;
  std::string output, to, card, order, prepare, format;
  RobotMotionArguments reading;
  std::optional<double> rate_hz;
  int threads = default_threads();
};

ConversionOptions conversion_of(const ConvertArguments& arguments) {
  ConversionOptions options{.to = arguments.to, .from = arguments.format};
  if (options.to != "paired")
    require(robot_motion_format(options.to).write != nullptr, "--to: format '{}' is read, not written", options.to);
  require(arguments.prepare.empty() || arguments.prepare == "sim-to-real",
          "--prepare: expected sim-to-real, found '{}'", arguments.prepare);
  options.sim_to_real = !arguments.prepare.empty();
  options.reading = options_of(arguments.reading);
  options.writing.rate_hz = arguments.rate_hz;
  if (!arguments.order.empty()) options.writing.order = parse_tree_order(arguments.order);
  return options;
}

void run_convert(const Session& session, const ConvertArguments& arguments) {
  const ConversionOptions options = conversion_of(arguments);
  const auto robot = load_shared_robot(arguments.card);
  const std::vector<std::string> files = find_robot_motions(arguments.inputs);
  const std::vector<std::string> outputs = converted_paths(files, arguments.output, options.to);
  std::vector<ConvertedMotion> made(files.size());
  Progress progress(session.progress());
  progress.start("converting", static_cast<int>(files.size()), "motions");
  parallel_for_each(static_cast<int>(files.size()), arguments.threads, [&](int i) {
    made[i] = convert_motion(files[i], outputs[i], *robot, options);
    progress.advance();
  });
  progress.finish();
  constexpr size_t kListed = 10;
  std::string text;
  nlohmann::json results = nlohmann::json::array();
  for (size_t i = 0; i < made.size(); ++i) {
    if (made.size() == 1)
      for (const std::string& sentence : made[i].evidence) text += "  " + sentence + "\n";
    if (i < kListed) text += fmt::format("{}: {} frames at {:g} Hz\n", made[i].file, made[i].frames, made[i].rate_hz);
    results.push_back({{"file", made[i].file},
                       {"source", files[i]},
                       {"frames", made[i].frames},
                       {"rate_hz", made[i].rate_hz},
                       {"evidence", made[i].evidence}});
  }
  if (made.size() > kListed) text += fmt::format("... and {} more in {}\n", made.size() - kListed, arguments.output);
  print(session, text, {{"converted", results}});
}

}  // namespace

void add_convert(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "convert", "robot motions into the formats of other tools",
                                  "duet convert paired --output gmr --to gmr\n"
                                  "  duet convert paired --output real --to paired --prepare sim-to-real");
  auto arguments = std::make_shared<ConvertArguments>();
  command->add_option("motions", arguments->inputs, "files of robot motions, or folders of them")->required();
  command->add_option("-o,--output", arguments->output, "folder, or a file for one motion")->required();
  command
      ->add_option("--to", arguments->to,
                   "format to write, of `duet list robot-formats`; paired: stays a paired motion")
      ->required();
  command->add_option_function<double>(
      "--rate", [arguments](double v) { arguments->rate_hz = v; },
      "frames per second of what is written (default: the motion's, or the format's where its files hold none)");
  command->add_option(
      "--order", arguments->order,
      "of joints and bodies in beyondmimic: breadth-first (IsaacLab, the default) or depth-first (mjlab)");
  command->add_option("--prepare", arguments->prepare,
                      "sim-to-real: Algorithm 7 on paired motions (neutral, straight preparation; still follow-up)");
  command->add_option("--card", arguments->card, "robot card by name or path (default: the G1)");
  command->add_option_function<double>(
      "--source-rate", [arguments](double v) { arguments->reading.options.rate_hz = v; },
      "frames per second of what is read (default: the file's)");
  command->add_option_function<double>(
      "--units", [arguments](double v) { arguments->reading.options.metres = v; },
      "metres per unit of what is read (default: detected)");
  command->add_option("--format", arguments->format,
                      "format that is read, of `duet list robot-formats` (default: by its content)");
  add_robot_motion_options(*command, arguments->reading);
  add_threads(command, arguments->threads);
  command->callback([&session, arguments] { run_convert(session, *arguments); });
}

}  // namespace duet::cli
