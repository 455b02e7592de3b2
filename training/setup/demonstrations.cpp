#include "duet/training/setup/demonstrations.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>
#include <utility>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/controller.h"
#include "duet/core/machine.h"
#include "duet/core/numbers.h"
#include "duet/experiment/plan/clips.h"
#include "duet/metrics/detector.h"
#include "duet/metrics/interaction.h"
#include "duet/motion/paired_motion.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/phase_adaptation.h"
#include "duet/robots/roles.h"
#include "duet/rollout/act_episode.h"
#include "duet/rollout/perturbations/partner_perturbation.h"
#include "duet/rows/episode_row.h"

namespace duet {
namespace {

constexpr std::size_t kBeforeFall = 50;  // frames
constexpr int kShortest = 100;
// Executed, an act is later than its reference by the usual lag; none is put off by more than half a second.
constexpr int kUsualLag = 8, kMostDelay = 25;                 // frames
constexpr double kQuickReaction = 0.15, kSlowReaction = 0.3;  // [s]
constexpr double kSlowWalk = 0.25, kQuickWalk = 0.5;          // [m/s]

// One motion to be followed, beside its partner.
struct Take {
  const PairedMotion* clip = nullptr;
  std::shared_ptr<const PairedMotion> waiting;  // the clip as it is seen where the robot leads
  AdaptedMotion adapted;
  PointTracks partner;
  std::vector<RobotState> followed;  // in the engine, while it was upright

  [[nodiscard]] const PairedMotion& seen() const { return waiting ? *waiting : *clip; }
};

// Frames by which the partner has to be ahead of the clip for the robot to begin a reaction after him. Nobody answers a
// partner who does not move, nor in a task whose act has no beginning to see.
int ahead(const PairedMotion& clip, const RobotMotion& motion, const RobotModel& robot, Random& random) {
  const double reaction = random.uniform(kQuickReaction, kSlowReaction);
  const ActOnset onset = definition_of(clip.task).interaction.onset;
  const std::optional<int> partner = act_onset(onset, human_agent(clip.partner.joints));
  const std::optional<int> own = act_onset(onset, robot_agent(robot, motion));
  if (!partner || !own) return 0;
  return std::max(0, *partner + ticks_of(reaction) - *own);
}

Take take_of(const PairedMotion& clip, const RobotModel& robot, const DemonstrationOptions& options,
             std::uint64_t seed) {
  Take take;
  take.clip = &clip;
  Random random(seed, stream_key({"answers"}));
  const bool gesture = definition_of(clip.task).interaction.touch == Touch::kNone;
  AdaptationOptions adaptation{.start = options.start};
  if (options.answers) adaptation.walks = random.uniform(kSlowWalk, kQuickWalk);
  take.adapted = adapt_by_phase(clip.robot, clip.phases, robot, adaptation, seed);
  if (options.leads && gesture && (random.chance(0.5) || !partner_begins(clip.task, clip.partner.joints))) {
    take.waiting = std::make_shared<const PairedMotion>(with_waiting_partner(clip));
    take.adapted = begun_at_once(take.adapted);
  } else if (options.answers) {
    take.adapted.clip_frame += ahead(clip, take.adapted.motion, robot, random);
  }
  take.partner = partner_motion(take.seen().partner, std::nullopt, take.adapted.phases, take.adapted.clip_frame,
                                take.adapted.motion.frames())
                     .joints;
  return take;
}

// Whether the meant motion passes the rule beside a partner whom it passes through.
bool passes(const Take& take, const RobotModel& robot) {
  return judge_interaction(take.clip->task, {.performer = robot_agent(robot, take.adapted.motion),
                                             .partner = human_agent(take.partner),
                                             .window = act_window(take.adapted.phases, kTickRate)})
      .success;
}

ControllerOptions controller_options(const DemonstrationOptions& options) {
  if (options.controller_network.empty()) return {};
  return {{"network", options.controller_network}};
}

void follow(Take& take, const std::shared_ptr<const RobotModel>& robot, const DemonstrationOptions& options,
            const PolicyMaker& make_policy, const LoadedController& make_controller) {
  const std::unique_ptr<Policy> policy = make_policy();
  RolloutSetup setup;
  setup.clip = &take.seen();
  setup.reference = take.adapted;
  setup.start = robot->standing_state(take.adapted.motion.root.front());
  setup.fall = robot->fall;
  Rollout rollout;
  if (options.engine == kPlaybackEngine) {
    rollout = play_back(setup, *policy);
  } else {
    Scene scene;
    scene.robot = robot;
    scene.human = make_human_body(bone_lengths(take.clip->partner));
    const std::unique_ptr<Backend> backend = make_backend(options.engine, scene);
    rollout = roll_out(setup, *backend, *make_controller.make(controller_options(options)), *policy);
  }
  take.followed = std::move(rollout.recording.robot);
  if (rollout.recording.outcome == Outcome::kOk) return;
  take.followed.resize(std::max<std::size_t>(take.followed.size(), kBeforeFall) - kBeforeFall);
}

// The first frames of a motion.
RobotMotion begin_of(const RobotMotion& motion, int frames) {
  return {motion.rate_hz,
          motion.joint_names,
          {motion.root.begin(), motion.root.begin() + frames},
          motion.q.leftCols(frames)};
}

void add(const Take& take, bool as_it_is, DemonstrationSet& set) {
  const Demonstration entry{take.clip->clip_id, clip_digest(*take.clip), take.clip->task, take.adapted.phases,
                            take.waiting != nullptr};
  const RobotMotion& motion = take.adapted.motion;
  if (as_it_is) set.add(entry, states_of(motion), motion, take.partner);
  const int frames = std::min(static_cast<int>(take.followed.size()), motion.frames());
  if (frames < kShortest) return;
  set.add(entry, {take.followed.begin(), take.followed.begin() + frames}, begin_of(motion, frames),
          take.partner.slice(0, frames));
}

struct Demonstrators {
  const std::shared_ptr<const RobotModel>& robot;
  const DemonstrationOptions& options;
  const PolicyMaker& make_policy;
  const LoadedController& make_controller;  // empty where no engine follows
  Progress& progress;
  const std::function<bool()>& stop;
};

// Adds the takes of one task; false where it was stopped.
bool demonstrate(Task task, const DemonstrationClips& kind, const PairOptions& pair, const Demonstrators& by,
                 DemonstrationSet& set) {
  const DemonstrationOptions& options = by.options;
  const bool itself = options.policy == "replay";
  const int per_task = itself ? kind.per_task : std::min(kind.per_task, options.followed);
  const int starts = itself ? options.starts : 1;
  const std::vector<PairedMotion> clips =
      synthetic_clips(*by.robot, pair, {task}, per_task, options.seed, options.threads, by.progress, kind.like);
  std::vector<std::optional<Take>> made(clips.size() * starts);
  by.progress.start(fmt::format("demonstrating {}", to_string(task)), static_cast<int>(made.size()), "takes");
  parallel_for_each(static_cast<int>(made.size()), options.threads, [&](int i) {
    if (by.stop()) return;
    const PairedMotion& clip = clips[i / starts];
    made[i] = take_of(clip, *by.robot, options, stream_key({"take", clip.clip_id, std::to_string(i % starts)}));
    if (options.answers && !passes(*made[i], *by.robot)) made[i].reset();
    const bool followed = made[i] && !options.engine.empty() && i % starts == 0 && i / starts < options.followed;
    if (followed) follow(*made[i], by.robot, options, by.make_policy, by.make_controller);
    if (followed && options.answers && !itself)
      made[i]->adapted =
          put_off(made[i]->adapted,
                  std::clamp(act_lag(made[i]->adapted, made[i]->followed, *by.robot) - kUsualLag, 0, kMostDelay));
    by.progress.advance();
  });
  by.progress.finish();
  if (by.stop()) return false;
  for (std::optional<Take>& take : made) {
    if (take) add(*take, itself, set);
    take.reset();
  }
  return true;
}

// The network's name, also where it is the controller's default; "" for a controller that has none.
std::string controller_network_of(const DemonstrationOptions& options) {
  if (!options.controller_network.empty()) return options.controller_network;
  for (const ControllerOption& option : controller_info(options.controller).options)
    if (option.name == "network") return option.fallback;
  return "";
}

}  // namespace

int act_lag(const AdaptedMotion& meant, const std::vector<RobotState>& did, const RobotModel& robot) {
  constexpr int kAround = 50, kLatest = 50;  // frames
  const int frames = std::min(static_cast<int>(did.size()), meant.motion.frames());
  const int begin = std::max(0, meant.phases.act_begin - kAround);
  const int end = std::min(frames, meant.phases.act_end + kAround + kLatest);
  const std::vector<int> upper = upper_joints(robot);
  double least = std::numeric_limits<double>::infinity();
  int best = 0;
  for (int lag = 0; lag <= kLatest; ++lag) {
    double apart = 0.0;
    for (int t = begin; t < end; ++t)
      for (const int j : upper) apart += std::abs(did[t].q[j] - meant.motion.q(j, std::max(0, t - lag)));
    if (apart >= least) continue;
    least = apart;
    best = lag;
  }
  return best;
}

AdaptedMotion put_off(const AdaptedMotion& meant, int frames) {
  AdaptedMotion late = meant;
  const int act = meant.phases.act_begin, last = meant.motion.frames();
  for (int t = act; t < last; ++t) {
    const int source = std::max(act, t - frames);
    late.motion.root[t] = meant.motion.root[source];
    late.motion.q.col(t) = meant.motion.q.col(source);
  }
  late.phases = {std::min(act + frames, last - 1), std::min(meant.phases.act_end + frames, last)};
  return late;
}

PairedMotion with_waiting_partner(const PairedMotion& clip) {
  constexpr int kBefore = 15, kSwing = 100;  // frames before the act in which he moves already; that he waits over
  PairedMotion waiting = clip;
  PointTracks& joints = waiting.partner.joints;
  const std::optional<int> begins =
      act_onset(definition_of(clip.task).interaction.onset, human_agent(clip.partner.joints));
  const int still = std::max(1, begins ? *begins - kBefore : joints.frames());
  const int swing = std::min(still, kSwing), period = std::max(1, 2 * (swing - 1));
  for (int t = still; t < joints.frames(); ++t) {
    const int at = (t - still + 1) % period;  // back from the last of them
    const int source = still - 1 - std::min(at, period - at);
    joints.frame(t) = clip.partner.joints.frame(source);
    for (int j = 0; !waiting.partner.rotations.empty() && j < kSmplJoints; ++j)
      waiting.partner.rotations[t * kSmplJoints + j] = clip.partner.rotations[source * kSmplJoints + j];
  }
  return waiting;
}

AdaptedMotion begun_at_once(const AdaptedMotion& waits) {
  constexpr int kPause = 25, kReturn = 50;  // frames
  const RobotMotion& from = waits.motion;
  const int last = from.frames(), act = waits.phases.act_begin, until = std::min(last, waits.phases.act_end + kReturn);
  int there = act;
  while (there > 0 && from.root[there - 1].p == from.root[act].p) --there;
  if (there + kPause >= act) return waits;
  AdaptedMotion made = waits;
  made.phases.act_begin = there + kPause;
  for (int begin = made.phases.act_begin; begin < last; begin += until - act + kPause) {
    for (int t = begin; t < std::min(last, begin + until - act); ++t) {
      made.motion.root[t] = from.root[act + t - begin];
      made.motion.q.col(t) = from.q.col(act + t - begin);
    }
    made.phases.act_end = std::min(last, begin + waits.phases.act_end - act);
    const int rests = begin + until - act;  // and goes back to where the act begins
    for (int t = rests; t < std::min(last, rests + kPause); ++t) {
      const double s = (t - rests + 1.0) / kPause;
      made.motion.root[t] = interpolate(from.root[until - 1], from.root[act - 1], s);
      made.motion.q.col(t) = (1.0 - s) * from.q.col(until - 1) + s * from.q.col(act - 1);
    }
  }
  return made;
}

PairOptions parse_retargeting(const std::string& text) {
  std::vector<std::pair<std::string, std::string>> choices;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    const auto equals = word.find('=');
    if (equals == std::string::npos)
      choices.emplace_back("mode", word);
    else
      choices.emplace_back(word.substr(0, equals), word.substr(equals + 1));
  }
  return make_pair_options(choices);
}

std::string origin_of(const DemonstrationOptions& options) {
  std::string clips;
  for (const auto& [like, per_task] : options.clips)
    clips += fmt::format("{}{}{}{}", clips.empty() ? "" : " and ", per_task, clips.empty() ? " clips of each task" : "",
                         like == Likeness::kPeople   ? " like people"
                         : like == Likeness::kVaried ? " that vary more"
                                                     : "");
  clips += fmt::format(" (seed {}), retargeted by {}, {} start{} of each{}", options.seed, options.retargeting,
                       options.starts, options.starts == 1 ? "" : "s",
                       options.start == StartMode::kSimToReal ? " for the real robot (Algorithm 7)"
                       : options.leads                        ? " in answer to the partner or to begin"
                       : options.answers                      ? " in answer to the partner"
                                                              : "");
  if (options.engine.empty()) return clips + ", none followed";
  const std::string network = controller_network_of(options);
  return fmt::format("{}, {} of a kind followed in {} under {}{} by {}", clips, options.followed, options.engine,
                     options.controller, network.empty() ? "" : fmt::format(" ({})", network), options.policy);
}

std::optional<DemonstrationSet> make_demonstrations(const std::shared_ptr<const RobotModel>& robot,
                                                    const DemonstrationOptions& options, Progress& progress,
                                                    const std::function<bool()>& stop) {
  const PolicyMaker maker = policy_maker(options.policy, robot, options.policy_options);
  const bool simulated = !options.engine.empty() && options.engine != kPlaybackEngine;
  const LoadedController controller =
      simulated ? load_controller(options.controller, robot, controller_options(options)) : LoadedController();
  const PairOptions pair = parse_retargeting(options.retargeting);
  DemonstrationSet set;
  set.robot_digest = robot->digest;
  set.origin = origin_of(options);
  for (const DemonstrationClips& kind : options.clips)
    for (const Task task : kPaperTasks)  // one at a time: hours of clips and takes are gigabytes
      if (!demonstrate(task, kind, pair, {robot, options, maker, controller, progress, stop}, set)) return std::nullopt;
  return set;
}

std::string split_text(const Suite& suite, int threads, Progress& progress) {
  const auto robot = load_shared_robot(suite.robot);
  std::string text = fmt::format("# The clips of {} {}: never learnt from.\n", suite.name, suite.version);
  for (const PairedMotion& clip : prepare_clips(suite, *robot, threads, progress))
    text += fmt::format("{}  {}\n", clip_digest(clip), clip.clip_id);
  return text;
}

std::vector<RobotMotion> training_motions(const RobotModel& robot, int per_task, int threads, Progress& progress) {
  std::vector<RobotMotion> motions;
  for (const PairedMotion& clip : synthetic_clips(robot, {}, {kPaperTasks.begin(), kPaperTasks.end()}, per_task,
                                                  kTrainingSeed, threads, progress)) {
    const AdaptationOptions options{.start = StartMode::kApproach};
    motions.push_back(adapt_by_phase(clip.robot, clip.phases, robot, options, kTrainingSeed + motions.size()).motion);
  }
  return motions;
}

}  // namespace duet
