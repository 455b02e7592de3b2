#include "duet/replay/replay_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <tuple>

#include "duet/archives/npy/npz.h"
#include "duet/core/file.h"
#include "duet/core/file_batch.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/execution/run_inputs.h"
#include "duet/execution/verification.h"
#include "duet/experiment/plan/clips.h"
#include "duet/motion/paired_motion.h"
#include "duet/robots/robot_cards.h"
#include "duet/rollout/world.h"

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
                                 excerpt(scene.id)));
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
  for (const std::string& file : files) with_file_context(file, [&] { add_file(file, card, content.scenes); });
  return content;
}

namespace {

bool is_wanted(const std::vector<std::string>& names, const std::string& name) {
  return names.empty() || std::ranges::find(names, name) != names.end();
}

void check_names(const char* kind, const std::vector<std::string>& asked, const std::vector<EpisodeRow>& rows,
                 std::string EpisodeRow::*field) {
  std::set<std::string> known;
  for (const EpisodeRow& row : rows) known.insert(row.*field);
  const std::vector<std::string> list(known.begin(), known.end());
  for (const std::string& name : asked) require(known.contains(name), unknown_name_message(kind, name, list));
}

// The null arm belongs to every policy.
bool fits(const EpisodeRow& row, const ReplayChoice& choice) {
  return is_wanted(choice.engines, row.engine) && is_wanted(choice.controllers, row.controller) &&
         (row.arm == "null" || is_wanted(choice.policies, row.policy)) &&
         is_wanted(choice.perturbations, row.perturbation) && is_wanted(choice.tasks, row.task);
}

bool begins_with_any(const EpisodeRow& row, const std::vector<std::string>& beginnings) {
  const std::string id = scene_id(row);
  return std::ranges::any_of(beginnings, [&](const std::string& beginning) {
    return row.key.starts_with(beginning) || id == beginning || id.starts_with(beginning + "/");
  });
}

// The controller, among those of the rows, with the best mean success in the main arm; of equal ones the first.
std::string best_controller(const std::vector<const EpisodeRow*>& rows) {
  std::map<std::string, std::pair<long, long>> counts;  // successes, all
  for (const EpisodeRow* row : rows) {
    if (row->arm != "main") continue;
    auto& [k, n] = counts[row->controller];
    k += row->success.value_or(false) ? 1 : 0;
    ++n;
  }
  std::string best;
  double rate = -1.0;
  for (const auto& [name, count] : counts) {
    const double own = static_cast<double>(count.first) / static_cast<double>(count.second);
    if (own > rate) std::tie(best, rate) = std::tuple(name, own);
  }
  return best;
}

double disagreement_of(const ChosenScene& scene) {
  int successes = 0, judged = 0;
  for (const EpisodeRow* row : scene.rows) {
    if (row->arm != "main" || !row->success) continue;
    ++judged;
    successes += *row->success ? 1 : 0;
  }
  return judged == 0 ? 0.0 : static_cast<double>(std::min(successes, judged - successes)) / judged;
}

// The main arm before others; then by policy, controller and engine, playback after the engines.
auto track_order(const EpisodeRow* row) {
  const int arm = row->arm == "main" ? 0 : row->arm == "null" ? 2 : 1;
  return std::tuple(arm, row->policy, row->controller, row->engine == kPlaybackEngine, row->engine);
}

std::vector<ChosenScene> scenes_of(const std::vector<const EpisodeRow*>& rows) {
  std::map<std::string, std::vector<const EpisodeRow*>> by_id;
  for (const EpisodeRow* row : rows) by_id[scene_id(*row)].push_back(row);
  std::vector<ChosenScene> scenes;
  for (auto& [id, own] : by_id) {
    std::ranges::sort(own, {}, track_order);
    scenes.push_back({id, std::move(own)});
  }
  std::ranges::stable_sort(scenes, std::greater(), disagreement_of);
  return scenes;
}

// The first `count`: the one of each task with the least agreement, before the second one of any; in the order as
// before.
std::vector<ChosenScene> least_agreeing(std::vector<ChosenScene> scenes, int count) {
  std::map<std::string, int> seen;
  std::map<std::string, int> place;  // of a scene among those of its task
  for (const ChosenScene& scene : scenes) place[scene.id] = seen[scene.rows.front()->task]++;
  std::ranges::stable_sort(scenes, {}, [&](const ChosenScene& scene) { return place[scene.id]; });
  scenes.resize(static_cast<std::size_t>(count));
  std::ranges::stable_sort(scenes, std::greater(), disagreement_of);
  return scenes;
}

}  // namespace

std::string scene_id(const EpisodeRow& row) {
  return fmt::format("{}/{}/{}/{}", row.task, row.clip, row.episode, row.perturbation);
}

ChosenRows chosen_rows(const std::vector<EpisodeRow>& rows, const ReplayChoice& choice) {
  check_names("engine", choice.engines, rows, &EpisodeRow::engine);
  check_names("controller", choice.controllers, rows, &EpisodeRow::controller);
  check_names("policy", choice.policies, rows, &EpisodeRow::policy);
  check_names("perturbation", choice.perturbations, rows, &EpisodeRow::perturbation);
  check_names("task", choice.tasks, rows, &EpisodeRow::task);
  std::vector<const EpisodeRow*> fitting;
  for (const EpisodeRow& row : rows)
    if (fits(row, choice) && (choice.episodes.empty() || begins_with_any(row, choice.episodes)))
      fitting.push_back(&row);
  for (const std::string& beginning : choice.episodes)
    require(std::ranges::any_of(fitting, [&](const EpisodeRow* row) { return begins_with_any(*row, {beginning}); }),
            "no episode begins with '{}': expected the beginning of a key, or task/clip/episode", beginning);
  ChosenRows chosen;
  std::set<std::string> controllers;
  for (const EpisodeRow* row : fitting) controllers.insert(row->controller);
  if (choice.controllers.empty() && choice.episodes.empty() && controllers.size() > 1) {
    const std::string best = best_controller(fitting);
    std::erase_if(fitting, [&](const EpisodeRow* row) { return row->controller != best; });
    chosen.notes.push_back(
        fmt::format("Controller {} alone, the one with the best mean success; --controllers shows others.", best));
  }
  require(!fitting.empty(), "no episode of the run is what --engines, --controllers, --policies, --tasks ask for");
  chosen.scenes = scenes_of(fitting);
  const auto all = static_cast<int>(chosen.scenes.size());
  if (choice.episodes.empty() && all > choice.scenes) {
    chosen.scenes = least_agreeing(std::move(chosen.scenes), choice.scenes);
    chosen.notes.push_back(fmt::format(
        "The {} of {} clips on which the tracks agree least, of different tasks first; --scenes shows more.",
        choice.scenes, all));
  }
  return chosen;
}

}  // namespace duet
