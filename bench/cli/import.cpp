// duet import: motion files of others -> duet's NPZ. A pair of BVH files becomes a clip, a pickled robot motion a
// recording.
#include <fmt/format.h>

#include <filesystem>

#include "bench/cli/command.h"
#include "bench/rollout.h"
#include "core/clock.h"
#include "core/require.h"
#include "motion/bvh.h"
#include "motion/pickle.h"
#include "robots/kinematics.h"

namespace duet::cli {
namespace {

struct ImportArguments {
  std::vector<std::string> files;
  std::string output, task, reactor = "B", up, robot;
  bool drop_t_pose = false, keep_t_pose = false;
  BvhOptions bvh;
};

std::string bulleted(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += "  " + line + "\n";
  return text;
}

void import_people(const Session& session, ImportArguments arguments) {
  require(!arguments.task.empty(), "--task is needed to import a pair of BVH files (hug, handshake, ...)");
  require(arguments.reactor == "A" || arguments.reactor == "B",
          fmt::format("--robot: expected A or B, found '{}'", arguments.reactor));
  if (!arguments.up.empty()) {
    require(arguments.up == "y" || arguments.up == "z", fmt::format("--up: expected y or z, found '{}'", arguments.up));
    arguments.bvh.up = arguments.up == "y" ? UpAxis::kY : UpAxis::kZ;
  }
  require(!(arguments.drop_t_pose && arguments.keep_t_pose), "--drop-t-pose and --keep-t-pose exclude each other");
  if (arguments.drop_t_pose) arguments.bvh.drop_t_pose = true;
  if (arguments.keep_t_pose) arguments.bvh.drop_t_pose = false;
  BvhImport imported =
      import_bvh_pair(arguments.files[0], arguments.files[1], parse_task(arguments.task), arguments.bvh);
  set_reactor(imported.clip, arguments.reactor == "A" ? Person::kA : Person::kB);
  save_clip(imported.clip, arguments.output);
  const Phases& phases = imported.clip.phases;
  print(session, fmt::format("{}{}: clip '{}'", bulleted(imported.verdict), arguments.output, imported.clip.id),
        {{"file", arguments.output},
         {"clip", imported.clip.id},
         {"verdict", imported.verdict},
         {"frames", imported.clip.frames()},
         {"act", {phases.act_begin, phases.act_end}}});
}

// Such pickles name no joints. As many columns as the robot has joints are taken in the card's order; six fewer are
// GMT's 23-joint body: the same order without the wrists, which are then straight. The verdict says which.
RobotMotion on_robot(const PickledMotion& pickled, const std::string& file, const RobotModel& robot,
                     std::vector<std::string>& verdict) {
  std::vector<int> rows;
  for (int j = 0; j < robot.dof(); ++j)
    if (robot.joints[j].name.find("wrist") == std::string::npos) rows.push_back(j);
  const Eigen::MatrixXd& q = pickled.motion.q;
  RobotMotion motion = pickled.motion;
  if (q.rows() == static_cast<Eigen::Index>(rows.size()) && q.rows() != robot.dof()) {
    motion.q = Eigen::MatrixXd::Zero(robot.dof(), q.cols());
    for (size_t i = 0; i < rows.size(); ++i) motion.q.row(rows[i]) = q.row(static_cast<Eigen::Index>(i));
    verdict.push_back(fmt::format("{} columns: the joints of '{}' without its wrists, which are held straight",
                                  q.rows(), robot.name));
  } else if (q.rows() != robot.dof()) {
    throw InputError(fmt::format("{}: expected {} joints for robot '{}' ({} without wrists), found {}", file,
                                 robot.dof(), robot.name, rows.size(), q.rows()));
  }
  motion.joint_names = robot.joint_names();
  return motion;
}

// Worst distance between the file's own body positions and our forward kinematics, over the robot's links. [m]
double kinematics_error(const PickledMotion& pickled, const RobotMotion& motion, const RobotModel& robot) {
  double worst = 0.0;
  Kinematics kinematics(robot);
  for (int t = 0; t < pickled.local_body_pos.frames(); ++t) {
    kinematics.update(Pose(), motion.q.col(t));
    for (size_t b = 0; b < pickled.link_body_list.size(); ++b) {
      for (size_t i = 0; i < robot.links.size(); ++i) {
        if (robot.links[i].name != pickled.link_body_list[b]) continue;
        worst = std::max(worst, (kinematics.p_WL(static_cast<int>(i)) - pickled.local_body_pos.at(t, b)).norm());
      }
    }
  }
  return worst;
}

void import_robot(const Session& session, const ImportArguments& arguments) {
  const auto robot = load_shared_robot(arguments.robot);
  const PickledMotion pickled = read_motion_pickle(arguments.files[0]);
  std::vector<std::string> verdict = pickled.verdict;
  const RobotMotion motion = on_robot(pickled, arguments.files[0], *robot, verdict);
  const RobotMotion resampled = resample(motion, kTickRate);
  verdict.push_back(fmt::format("resampled: {} frames at {:.4g} Hz -> {} frames at {:g} Hz", motion.frames(),
                                motion.rate_hz, resampled.frames(), kTickRate));
  const double error = kinematics_error(pickled, motion, *robot);
  if (!pickled.link_body_list.empty())
    verdict.push_back(fmt::format("its body positions and our kinematics differ by {:.2e} m at most", error));
  const Recording recording = play_back(resampled, {}, Task::kHug, {0, resampled.frames()}, robot);
  save_recording(recording, arguments.output);
  print(session, fmt::format("{}{}: recording of {} frames", bulleted(verdict), arguments.output, recording.frames()),
        {{"file", arguments.output},
         {"frames", recording.frames()},
         {"kinematics_error_m", error},
         {"verdict", verdict}});
}

void run_import(const Session& session, const ImportArguments& arguments) {
  const std::string extension = std::filesystem::path(arguments.files[0]).extension().string();
  if (extension == ".pkl") {
    require(arguments.files.size() == 1, "a robot motion (.pkl) is imported alone");
    import_robot(session, arguments);
  } else if (extension == ".bvh") {
    require(arguments.files.size() == 2,
            fmt::format("expected a pair of BVH files, one a person, found {}", arguments.files.size()));
    import_people(session, arguments);
  } else {
    throw std::invalid_argument(fmt::format("'{}': expected a pair of .bvh files or one .pkl", arguments.files[0]));
  }
}

}  // namespace

void add_import(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "import", "read motion files of others",
                                  "duet import 18_01.bvh 19_01.bvh --task handshake --output handshake.npz\n"
                                  "  duet import walk_001.pkl --output walk.npz");
  auto arguments = std::make_shared<ImportArguments>();
  command->add_option("files", arguments->files, "two BVH files, person A then B; or one pickled robot motion")
      ->required();
  command->add_option("-o,--output", arguments->output, "clip or recording to write (NPZ)")->required();
  command->add_option("--task", arguments->task, "task of the clip");
  command->add_option("--robot", arguments->reactor, "who the robot replaces: A or B")->capture_default_str();
  command->add_option("--card", arguments->robot,
                      "robot card of a pickled motion (default: the G1 that ships with duet)");
  command->add_option_function<double>(
      "--units", [arguments](double v) { arguments->bvh.metres_per_unit = v; },
      "metres per unit of the file (default: detected)");
  command->add_option("--up", arguments->up, "up axis, y or z (default: detected)");
  command->add_option_function<double>(
      "--rate", [arguments](double v) { arguments->bvh.rate_hz = v; },
      "frames per second (default: the file's frame time)");
  command->add_flag("--drop-t-pose", arguments->drop_t_pose, "frame 0 is an added T pose: drop it (default: detected)");
  command->add_flag("--keep-t-pose", arguments->keep_t_pose, "keep frame 0 whatever it is");
  command->callback([&session, arguments] { run_import(session, *arguments); });
}

}  // namespace duet::cli
