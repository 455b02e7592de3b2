// duet import: motion files of others -> duet's NPZ. Two people, in any format of motion/people/, become a clip, a
// robot's motion, in any of formats/, a recording.
#include "duet/parts/data/import.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "duet/archives/recording_file.h"
#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/formats/robot_motion_format.h"
#include "duet/parts/data/part.h"
#include "duet/parts/data/people_arguments.h"
#include "duet/people/formats/people_formats.h"
#include "duet/rollout/world.h"

namespace duet::cli {
namespace {

struct ImportArguments {
  std::vector<std::string> files;
  std::string output, card, clip;
  bool list = false;
  PeopleArguments people;
  RobotMotionArguments robot_motion;
};

std::string bulleted(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += "  " + line + "\n";
  return text;
}

nlohmann::json report_of(const SourceClip& imported, const std::string& file) {
  const Phases& phases = imported.clip.phases;
  return {{"file", file},
          {"clip", imported.clip.id},
          {"verdict", imported.evidence},
          {"frames", imported.clip.frames()},
          {"act", {phases.act_begin, phases.act_end}}};
}

// Every clip into a folder; one that is refused is said and counted, the others go on.
void import_all(const Session& session, const PeopleFormat& format, const std::vector<ClipPlace>& places,
                const PeopleOptions& options, const std::string& folder) {
  std::string text;
  std::set<std::string> written;
  nlohmann::json clips = nlohmann::json::array(), refused = nlohmann::json::array();
  for (const ClipPlace& place : places) {
    try {
      if (!written.insert(place.id).second)
        throw InputError(fmt::format("'{}': another clip has the id '{}'", place.files.front(), place.id));
      const SourceClip imported = read_source_clip(format, place, options);
      const std::string file = fmt::format("{}/{}.npz", folder, place.id);
      save_clip(imported.clip, file);
      clips.push_back(report_of(imported, file));
    } catch (const StorageError&) {
      throw;
    } catch (const InputError& error) {
      text += fmt::format("refused: {}\n", error.what());
      refused.push_back({{"clip", place.id}, {"reason", error.what()}});
    }
  }
  if (clips.empty()) throw InputError(fmt::format("{}none of {} clips was imported", text, places.size()));
  print(session,
        fmt::format("{}{}: {} clips of format {}, {} refused", text, folder, clips.size(), format.name, refused.size()),
        {{"format", format.name}, {"clips", clips}, {"refused", refused}});
}

void list_places(const Session& session, const PeopleFormat& format, const std::vector<ClipPlace>& places) {
  std::string text = fmt::format("{} clips of format {}", places.size(), format.name);
  nlohmann::json clips = nlohmann::json::array();
  for (const ClipPlace& place : places) {
    text += fmt::format("\n  {}  {}", place.id, place.files.front());
    clips.push_back({{"clip", place.id}, {"files", place.files}, {"notes", place.notes}});
  }
  print(session, text, {{"format", format.name}, {"clips", clips}});
}

void import_people(const Session& session, const ImportArguments& arguments) {
  const PeopleFormat& format = find_people_format(arguments.files, arguments.people.format);
  if (format.name == "bvh" && !arguments.list)
    require(!arguments.people.task.empty(), "--task is needed to import a pair of BVH files (hug, handshake, ...)");
  const PeopleOptions options = people_options(arguments.people);
  std::vector<ClipPlace> places = format.find(arguments.files, options);
  if (arguments.list) return list_places(session, format, places);
  require(!arguments.output.empty(), "--output is needed: the clip to write, or a folder for several");
  if (!arguments.clip.empty()) {
    std::vector<std::string> ids;
    ids.reserve(places.size());
    for (const ClipPlace& place : places) ids.push_back(place.id);
    std::erase_if(places, [&](const ClipPlace& place) { return place.id != arguments.clip; });
    require(!places.empty(), unknown_name_message("clip", arguments.clip, ids));
  }
  const bool one_file = format.name == "bvh" || std::filesystem::path(arguments.output).extension() == ".npz";
  if (!one_file) return import_all(session, format, places, options, arguments.output);
  require(places.size() == 1,
          "{} clips were found, and one file to write: name one with --clip, or give a "
          "folder as --output",
          places.size());
  SourceClip imported = read_source_clip(format, places.front(), options);
  if (format.name == "bvh") imported.evidence.erase(imported.evidence.begin());  // its name is in the files'
  save_clip(imported.clip, arguments.output);
  print(session, fmt::format("{}{}: clip '{}'", bulleted(imported.evidence), arguments.output, imported.clip.id),
        report_of(imported, arguments.output));
}

// Any format of formats/robot_motion_format.h.
void import_robot(const Session& session, const ImportArguments& arguments) {
  const auto robot = load_shared_robot(arguments.card);
  RobotMotionOptions options = options_of(arguments.robot_motion);
  options.rate_hz = arguments.people.options.rate_hz;
  options.metres = arguments.people.options.metres_per_unit;
  RobotMotionFile read = read_robot_motion(arguments.files[0], *robot, options, arguments.people.format);
  const RobotMotion resampled = resample(read.motion, kTickRate);
  read.evidence.push_back(fmt::format("resampled: {} frames at {:.4g} Hz -> {} frames at {:g} Hz", read.motion.frames(),
                                      read.motion.rate_hz, resampled.frames(), kTickRate));
  const Recording recording = play_back(resampled, {}, std::nullopt, {0, resampled.frames()}, robot);
  save_recording(recording, arguments.output);
  nlohmann::json json = {
      {"file", arguments.output}, {"format", read.format}, {"frames", recording.frames()}, {"verdict", read.evidence}};
  if (read.kinematics_error) json["kinematics_error_m"] = *read.kinematics_error;
  print(session,
        fmt::format("{}{}: recording of {} frames", bulleted(read.evidence), arguments.output, recording.frames()),
        json);
}

// Endings of files that robots' motions have: what is wrong with one that no format of people knows, their reader says.
bool ends_like_robot_motion(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  return ending == ".csv" || ending == ".npy" || ending == ".pickle" || ending == ".joblib";
}

// By the format that is named, else by what is in the file; a pickle that is nobody's is a robot's that is broken.
bool is_robot_motion(const ImportArguments& arguments) {
  const std::vector<std::string> names = robot_motion_format_names();
  if (!arguments.people.format.empty()) return std::ranges::count(names, arguments.people.format) > 0;
  if (arguments.files.size() != 1) return false;
  require_data(arguments.files[0]);
  const auto people = std::ranges::find_if(
      people_formats(), [&](const PeopleFormat& format) { return format.recognises(arguments.files); });
  if (people != people_formats().end() && people->name != "positions") return false;
  if (std::filesystem::path(arguments.files[0]).extension() == ".pkl") return true;
  try {
    const MotionSource source = open_motion_source(arguments.files[0]);
    return std::ranges::any_of(robot_motion_formats(),
                               [&](const RobotMotionFormat& format) { return format.recognises(source); });
  } catch (const InputError&) {
    return people == people_formats().end() && ends_like_robot_motion(arguments.files[0]);
  }
}

void run_import(const Session& session, const ImportArguments& arguments) {
  if (!is_robot_motion(arguments)) return import_people(session, arguments);
  require(arguments.files.size() == 1, "expected one robot motion, found {} files", arguments.files.size());
  require(!arguments.output.empty(), "--output is needed: the recording to write");
  import_robot(session, arguments);
}

}  // namespace

void add_import(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "import", "read motion files of others",
                                  "duet import 18_01.bvh 19_01.bvh --task handshake --output handshake.npz\n"
                                  "  duet import walk_001.pkl --output walk.npz\n"
                                  "  duet import examples/data/inter_x --output people");
  auto arguments = std::make_shared<ImportArguments>();
  command
      ->add_option("files", arguments->files,
                   "motion of two people, in files or folders (`duet list people-formats`); or one robot motion "
                   "(`duet list robot-formats`)")
      ->required();
  command->add_option("-o,--output", arguments->output,
                      "clip or recording to write (.npz), or a folder for all clips that are found");
  command->add_flag("--list", arguments->list, "say which clips are there and write nothing");
  command->add_option("--clip", arguments->clip, "only the clip of this id");
  add_people_options(*command, arguments->people);
  command->add_option("--card", arguments->card, "robot card of a robot motion, by name or path (default: the G1)");
  add_robot_motion_options(*command, arguments->robot_motion);
  command->callback([&session, arguments] { run_import(session, *arguments); });
}

void add_robot_motion_options(CLI::App& command, RobotMotionArguments& arguments) {
  command.add_option("--quaternion", arguments.quaternion, "of a robot's root: xyzw or wxyz (default: detected)");
  command.add_option("--joints", arguments.joints,
                     "order of a robot's joints: depth-first or breadth-first (default: detected)");
  command.add_option("--angles", arguments.angles, "of a robot's joints: rad or deg (default: detected)");
  command.add_option("--motion", arguments.options.motion, "of a file with several robot motions: its name or number");
}

RobotMotionOptions options_of(const RobotMotionArguments& arguments) {
  RobotMotionOptions options = arguments.options;
  if (!arguments.quaternion.empty()) options.quaternion = parse_quaternion_order(arguments.quaternion);
  if (!arguments.joints.empty()) options.joints = parse_tree_order(arguments.joints);
  if (!arguments.angles.empty()) options.angles = parse_angle_unit(arguments.angles);
  return options;
}

}  // namespace duet::cli
