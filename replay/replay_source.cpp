#include "duet/replay/replay_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "duet/archives/npy/npz.h"
#include "duet/core/naming_file.h"
#include "duet/core/require.h"
#include "duet/core/scratch_folder.h"
#include "duet/core/shell_word.h"
#include "duet/core/text.h"
#include "duet/execution/run_inputs.h"
#include "duet/execution/verification.h"
#include "duet/experiment/plan/clips.h"
#include "duet/motion/paired_motion.h"
#include "duet/robots/robot_cards.h"
#include "duet/rollout/play_back.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

std::string recording_file(const std::string& folder, const EpisodeRow& row) {
  return (fs::path(folder) / (row.key.substr(0, 16) + ".npz")).string();
}

// An episode that never began has none.
bool has_motion(const EpisodeRow& row) {
  return row.frames > 0 && row.outcome != Outcome::kUnsupported && row.outcome != Outcome::kError;
}

std::shared_ptr<const RobotModel> robot_for(const std::string& digest, const std::string& card,
                                            const std::string& what) {
  if (!card.empty()) return load_shared_robot(card);
  if (std::shared_ptr<const RobotModel> robot = robot_of_digest(digest)) return robot;
  throw InputError(
      fmt::format("{}: expected the robot card of digest {:.8}, which no card of this machine has; --card "
                  "names one",
                  what, digest));
}

void check_fit(const Recording& recording, const RobotModel& robot, const std::string& what) {
  for (const RobotState& state : recording.robot)
    if (state.q.size() != robot.dof())
      throw InputError(
          fmt::format("{}: expected the {} joints of '{}', found {}", what, robot.dof(), robot.name, state.q.size()));
}

std::string track_name(const EpisodeRow& row) {
  const std::string policy = row.arm == "main"   ? row.policy
                             : row.arm == "null" ? "null arm"
                                                 : row.policy + ", shuffled";
  return fmt::format("{} · {} · {}", row.engine, row.controller, policy);
}

ReplayTrack track_of(const EpisodeRow& row, const std::string& file, const ReplayChoice& choice) {
  EpisodeRecording episode = read_episode_recording(Npz::load(file));
  ReplayTrack track;
  track.recording = std::move(episode.recording);
  track.kept = episode.kept ? std::move(episode.kept) : KeptEpisode{row, {}, {}};
  track.kept->row = row;
  track.robot = robot_for(row.robot_digest, choice.card, fmt::format("episode {:.16}", row.key));
  check_fit(track.recording, *track.robot, fmt::format("'{}'", file));
  track.name = track_name(row);
  return track;
}

void count(const ReplayTrack& track, ReplayScene& scene) {
  if (!track.kept || track.kept->row.arm != "main" || !track.kept->row.success) return;
  ++scene.judged;
  scene.successes += *track.kept->row.success ? 1 : 0;
}

// Runs again, in a folder of its own, what has to be; returns the hashes of the states.
std::map<std::string, std::string> repeated_hashes(const Run& run, const ChosenRows& chosen, const ReplayChoice& choice,
                                                   const std::string& folder, Progress& progress) {
  std::vector<std::string> keys;
  for (const ChosenScene& scene : chosen.scenes)
    for (const EpisodeRow* row : scene.rows)
      if (has_motion(*row) && (choice.run_again || !has_kept_recording(run, *row))) keys.push_back(row->key);
  if (keys.empty()) return {};
  VerifyOptions options;
  options.threads = choice.threads;
  options.allow_programs = choice.allow_programs;
  return record_again(run, keys, folder, options, progress);
}

ReplayScene scene_of(const Run& run, const ChosenScene& chosen, const ReplayChoice& choice, const std::string& scratch,
                     const std::map<std::string, std::string>& hashes, std::vector<std::string>& notes) {
  ReplayScene scene;
  const EpisodeRow& first = *chosen.rows.front();
  scene.id = chosen.id;
  scene.name = first.clip;
  scene.task = first.task;
  scene.perturbation = first.perturbation;
  for (const EpisodeRow* row : chosen.rows) {
    const auto repeat = hashes.find(row->key);
    const bool again = repeat != hashes.end();
    const std::string file = recording_file(again ? scratch : run.path + "/trajectories", *row);
    if (!has_motion(*row) || !fs::exists(file)) {
      notes.push_back(fmt::format("{}, {}: {}, so there is no motion to show.", scene.id, track_name(*row),
                                  row->message.empty() ? std::string(to_string(row->outcome)) : row->message));
      continue;
    }
    ReplayTrack& track = scene.tracks.emplace_back(track_of(*row, file, choice));
    track.repeat = fmt::format("duet replay {} --episodes {:.16} --run-again", shell_word(run.path), row->key);
    track.origin = !again                              ? "kept by the run"
                   : repeat->second == row->state_hash ? "run again: the same states, bit for bit"
                                                       : "run again: NOT the states that the run had";
    count(track, scene);
  }
  return scene;
}

ReplayTrack track_of_recording(const std::string& file, const Npz& npz, const std::string& card) {
  EpisodeRecording episode = read_episode_recording(npz);
  ReplayTrack track;
  track.recording = std::move(episode.recording);
  track.kept = std::move(episode.kept);
  track.robot =
      track.kept ? robot_for(track.kept->row.robot_digest, card, fmt::format("'{}'", file)) : load_shared_robot(card);
  check_fit(track.recording, *track.robot, fmt::format("'{}'", file));
  const std::string stem = fs::path(file).stem().string();
  track.name = track.kept ? track_name(track.kept->row) : stem;
  track.origin = "read from " + file;
  return track;
}

// Two people without a robot.
ReplayTrack track_of_people(const HumanMotion& actor, const HumanMotion& reactor, Task task, const Phases& phases) {
  ReplayTrack track;
  track.recording.task = task;
  track.recording.phases = phases;
  track.recording.rate_hz = actor.rate_hz;
  track.recording.partner = actor.joints;
  track.other_person = reactor.joints;
  return track;
}

// `who`: a clip and what was made of it have one id.
ReplayScene motion_scene(const std::string& id, Task task, const std::string& who) {
  ReplayScene scene;
  scene.task = to_string(task);
  scene.id = scene.task + '/' + id + '/' + who;
  scene.name = id + ", " + who;
  return scene;
}

ReplayScene scene_of_clip(const std::string& file, const Npz& npz) {
  const InteractionClip clip = read_clip(npz);
  ReplayScene scene = motion_scene(clip.id, clip.task, "people");
  ReplayTrack& track =
      scene.tracks.emplace_back(track_of_people(clip.actor_motion(), clip.reactor_motion(), clip.task, clip.phases));
  track.name = "the two people";
  track.origin = "people of a clip, read from " + file;
  return scene;
}

std::shared_ptr<const RobotModel> robot_of_motion(const PairedMotion& motion, const std::string& card) {
  const auto named = motion.settings.find("robot");
  const auto is_named = [&](const RobotCardFile& known) {
    return named != motion.settings.end() && known.name == named->second;
  };
  const bool is_known = card.empty() && std::ranges::any_of(robot_cards(), is_named);
  std::shared_ptr<const RobotModel> robot = load_shared_robot(is_known ? named->second : card);
  if (motion.robot.joint_names != robot->joint_names())
    throw InputError(
        fmt::format("clip '{}' was retargeted to another robot: its joints are not those of '{}'; --card "
                    "names a card",
                    motion.clip_id, robot->name));
  return robot;
}

ReplayScene scene_of_paired(const std::string& file, const Npz& npz, const std::string& card) {
  const PairedMotion motion = read_paired_motion(npz);
  ReplayScene scene = motion_scene(motion.clip_id, motion.task, "robot");
  ReplayTrack robot;
  robot.robot = robot_of_motion(motion, card);
  robot.recording = play_back(motion.robot, motion.partner.joints, motion.task, motion.phases, robot.robot);
  robot.name = fmt::format("{} and adapted partner", robot.robot->name);
  robot.origin = "a paired motion, played back without physics, read from " + file;
  ReplayTrack people = track_of_people(motion.source_partner, motion.source_reactor, motion.task, motion.phases);
  people.name = "people as recorded";
  people.origin = "what the robot's motion was made from, read from " + file;
  scene.tracks = {std::move(robot), std::move(people)};
  return scene;
}

// The scene of the row's or the file's name, which is new or was there before.
ReplayScene& scene_for(const std::string& file, const ReplayTrack& track, std::vector<ReplayScene>& scenes) {
  const std::string id = track.kept ? scene_id(track.kept->row) : fs::path(file).stem().string();
  const auto found = std::ranges::find(scenes, id, &ReplayScene::id);
  if (found != scenes.end()) return *found;
  ReplayScene& scene = scenes.emplace_back();
  scene.id = id;
  scene.name = track.kept ? track.kept->row.clip : id;
  scene.task = track.recording.task ? std::string(to_string(*track.recording.task)) : "";
  scene.perturbation = track.kept ? track.kept->row.perturbation : "";
  return scene;
}

void add_file(const std::string& file, const std::string& card, std::vector<ReplayScene>& scenes) {
  const Npz npz = Npz::load(file);
  const MotionFile kind = kind_of(npz);
  if (kind == MotionFile::kRecording) {
    ReplayTrack track = track_of_recording(file, npz, card);
    ReplayScene& scene = scene_for(file, track, scenes);
    count(track, scene);
    scene.tracks.push_back(std::move(track));
    return;
  }
  ReplayScene scene = kind == MotionFile::kClip ? scene_of_clip(file, npz) : scene_of_paired(file, npz, card);
  if (std::ranges::find(scenes, scene.id, &ReplayScene::id) != scenes.end())
    throw InputError(fmt::format("'{}': '{}' is among the files already; each motion has a scene of its own", file,
                                 shown(scene.id)));
  scenes.push_back(std::move(scene));
}

}  // namespace

double ReplayScene::disagreement() const {
  return judged == 0 ? 0.0 : static_cast<double>(std::min(successes, judged - successes)) / judged;
}

bool has_kept_recording(const Run& run, const EpisodeRow& row) {
  return has_motion(row) && fs::exists(recording_file(run.path + "/trajectories", row));
}

ReplayContent replay_of_run(const Run& run, const ReplayChoice& choice, Progress& progress) {
  const ChosenRows chosen = chosen_rows(run.rows, choice);
  const Suite suite = suite_of_head(run);
  const ScratchFolder scratch;
  ReplayContent content;
  content.title = fmt::format("{} {}", suite.name, suite.version);
  content.notes = chosen.notes;
  content.episodes_of_run = static_cast<long>(run.rows.size());
  content.limits =
      load_contact_limits(suite.contact_limits.empty() ? default_contact_limits_path() : suite.contact_limits);
  const auto hashes = repeated_hashes(run, chosen, choice, scratch.path(), progress);
  for (const ChosenScene& scene : chosen.scenes) {
    ReplayScene made = scene_of(run, scene, choice, scratch.path(), hashes, content.notes);
    if (!made.tracks.empty()) content.scenes.push_back(std::move(made));
  }
  if (content.scenes.empty())
    throw InputError(fmt::format("'{}': none of the episodes chosen has a motion to show", run.path));
  return content;
}

ReplayContent replay_of_files(const std::vector<std::string>& files, const std::string& card) {
  ReplayContent content;
  content.title = fs::path(files.front()).filename().string();
  content.limits = load_contact_limits(default_contact_limits_path());
  for (const std::string& file : files) naming_file(file, [&] { add_file(file, card, content.scenes); });
  return content;
}

}  // namespace duet
