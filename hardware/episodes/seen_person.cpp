#include "duet/hardware/episodes/seen_person.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <utility>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/hardware/episodes/guarded_episode.h"
#include "duet/hardware/twin/lock_step.h"
#include "duet/policies/language.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/robot_cards.h"
#include "duet/rollout/act_episode.h"

namespace duet {
namespace {

constexpr double kBegins = 0.1;  // of a hand from where it hung [m]
constexpr double kWaitPeriod = 1.0 / 30.0;

std::span<const std::byte> bytes_of(const std::string& text) { return std::as_bytes(std::span(text)); }

// The guard of a twin that hears of recorded estimates as it would of a camera's.
class RecordedCamera final : public GuardLink {
 public:
  // `still`: the estimate that comes again until play() is called.
  RecordedCamera(TwinInProcess& link, const std::vector<RecordedEstimate>& estimates, const PersonEstimate& still,
                 const CameraMount& camera)
      : link_(link), estimates_(estimates), still_(still), placer_(camera) {}

  // The recording begins now.
  void play() {
    began_at_ = now_;
    before_ = link_.guard().status().person;
  }
  // Since then.
  [[nodiscard]] PersonCounts counts() const {
    PersonCounts counts = link_.guard().status().person;
    for (std::size_t k = 0; k < kPersonFaults; ++k) counts[k] -= before_[k];
    return counts;
  }

  bool send(const PlannerMessage& message) override { return link_.send(message); }
  bool send(const PersonMessage& message) override { return link_.send(message); }
  bool stop() override { return link_.stop(); }
  bool next(GuardReport& report) override {
    placer_.base(link_.guard().measured().X_WB, now_);
    if (began_at_)
      while (played_ < estimates_.size() && estimates_[played_].at <= now_ - *began_at_ + 1e-9)
        take(estimates_[played_++]);
    else
      wait();
    const bool came = link_.next(report);
    now_ = report.now;
    return came;
  }
  [[nodiscard]] double patience() const override { return link_.patience(); }
  [[nodiscard]] std::string name() const override { return "the guard of the dry run"; }

 private:
  void take(const RecordedEstimate& recorded) {
    PersonEstimate estimate;
    const PersonFault fault = decode(bytes_of(recorded.bytes), estimate);
    if (fault != PersonFault::kNone) return link_.guard().note_estimate(fault);
    estimate.sequence += still_.sequence;
    place(estimate);
  }
  void wait() {
    if (now_ - stood_at_ < kWaitPeriod) return;
    stood_at_ = now_;
    ++still_.sequence;
    place(still_);
  }
  void place(const PersonEstimate& estimate) {
    const PersonFault fault = placer_.place(estimate, now_, message_);
    if (fault == PersonFault::kNone)
      link_.guard().receive(message_, now_);
    else
      link_.guard().note_estimate(fault);
  }

  TwinInProcess& link_;
  const std::vector<RecordedEstimate>& estimates_;
  PersonEstimate still_;
  PersonPlacer placer_;
  PersonMessage message_;
  PersonCounts before_{};
  std::size_t played_ = 0;
  double now_ = 0.0, stood_at_ = kNever;
  std::optional<double> began_at_;
};

// The policy, once whose episode begins the recording plays.
class SeenReference final : public ReferenceSource {
 public:
  SeenReference(Policy& policy, PolicyReferenceOptions options, RecordedCamera& camera)
      : reference_(policy, std::move(options)), camera_(camera) {}
  void begin(const RobotState& start) override {
    camera_.play();
    reference_.begin(start);
  }
  const Reference* at(const TickView& present) override { return reference_.at(present); }
  [[nodiscard]] std::string message() const override { return reference_.message(); }

 private:
  PolicyReference reference_;
  RecordedCamera& camera_;
};

GuardSetup setup_of_dry_run(const RobotConfig& config) {
  GuardSetup setup = guard_setup(config, false);
  setup.executor = ExecutorKind::kTwin;
  setup.odometry = OdometrySource::kTwin;
  setup.rules.executor_answers = false;
  setup.mode_machine = TwinOptions{}.mode_machine;
  return setup;
}

GuardedEpisode episode_of_dry_run(const RobotConfig& config, const RobotModel& robot) {
  GuardedEpisode episode;
  episode.limits = config.limits;
  for (const std::vector<int>& arm : robot.roles.arms)
    episode.joints.insert(episode.joints.end(), arm.begin(), arm.end());
  episode.perceives = episode.records_seen = true;
  return episode;
}

// When a hand leaves its place, and how near one comes to a hand of the person.
void measure_hands(const Recording& recording, const RobotModel& robot, SeenTask& seen) {
  Kinematics kinematics(robot);
  std::array<Eigen::Vector3d, 2> hung;
  seen.nearest = std::numeric_limits<double>::infinity();
  for (int t = 0; t < recording.frames(); ++t) {
    const RobotState& state = recording.robot[static_cast<std::size_t>(t)];
    kinematics.update(state.X_WB, state.q);
    const Pose X_BW = state.X_WB.inverse();
    for (std::size_t side = 0; side < 2; ++side) {
      const Eigen::Vector3d p_WH = kinematics.frame_position(robot.tracks.at(side == 0 ? "lhand" : "rhand"));
      const Eigen::Vector3d p_BH = X_BW * p_WH;
      if (t == 0) hung[side] = p_BH;
      if (!seen.begins_at && (p_BH - hung[side]).norm() > kBegins) seen.begins_at = t * kTick;
      for (const int joint : {kLeftHand, kRightHand}) {
        const double apart = (recording.partner.at(t, joint) - p_WH).norm();
        if (apart < seen.nearest) seen.nearest = apart, seen.nearest_at = t * kTick;
      }
    }
    const double walked = (state.X_WB.p - recording.robot.front().X_WB.p).head<2>().norm();
    seen.walked = std::max(seen.walked, walked);
  }
}

}  // namespace

SeenTask see_person(const std::vector<RecordedEstimate>& estimates, const SeenOptions& options, Policy& policy,
                    Task task) {
  require(!estimates.empty(), "a dry run: expected estimates of a person, found none");
  SeenTask seen{.task = task, .estimates = counts_of(estimates)};
  seen.ticks = ticks_of(estimates.back().at) + 2;  // the last one arrives, too
  PersonEstimate still;
  const bool somebody = std::ranges::any_of(estimates, [&](const RecordedEstimate& one) {
    return decode(bytes_of(one.bytes), still) == PersonFault::kNone && still.seen;
  });
  if (!somebody) {
    seen.message = "no estimate could be used";
    return seen;
  }
  still.sequence = 0;
  const std::shared_ptr<const RobotModel> robot = load_shared_robot();
  TwinOptions twin;
  twin.seed = options.seed;
  TwinInProcess link(setup_of_dry_run(options.config), twin, nullptr, nullptr);
  RecordedCamera camera(link, estimates, still, options.config.camera);
  GuardedWorld world(episode_of_dry_run(options.config, *robot), robot, camera);
  Episode episode;
  episode.start = robot->standing_state();
  episode.ticks = seen.ticks;
  episode.partner = PointTracks(seen.ticks + 1, kSmplJoints);
  SeenReference reference(policy,
                          {.context = {.task = task,
                                       .prompt = std::string(task_prompt(task)),
                                       .start = episode.start,
                                       .seed = options.seed}},
                          camera);
  Rollout rollout;
  try {
    rollout = roll_out(episode, world, reference, "twin");
  } catch (const std::runtime_error& error) {  // it does not run
    seen.message = error.what();
    return seen;
  }
  seen.ran = true;
  seen.outcome = rollout.recording.outcome;
  seen.message = rollout.recording.message;
  seen.estimates = camera.counts();
  seen.held_ticks = world.held_ticks();
  seen.unseen_ticks = world.unseen_ticks();
  seen.clamps = world.clamps();
  measure_hands(rollout.recording, *robot, seen);
  return seen;
}

}  // namespace duet
