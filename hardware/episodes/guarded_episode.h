// An episode of a suite over a robot behind its guard, and what came of many of them beside the same episodes in the
// simulator: success with intervals and a paired test.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "duet/execution/experiment.h"
#include "duet/experiment/plan/episode.h"
#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/guard/walker.h"
#include "duet/hardware/log/run_log.h"
#include "duet/hardware/safety/contact_watch.h"
#include "duet/metrics/contact_safety.h"
#include "duet/rollout/rollout.h"
#include "duet/statistics/statistics.h"

namespace duet {

// A robot behind its guard as the world of an episode (rollout/world.h): the reference's root becomes a velocity by the
// law of supplement A.4.3, its joints targets, both go to the guard, and what the guard reports is the state. The world
// is laid so that the episode's start is where the robot stands. One owner, one thread.

// An estimate of the person at a tick of the episode, in its frame; false where there is none now.
using PartnerSource = std::function<bool(int tick, PersonMessage& seen)>;

// The defects of a twin's camera and estimator.
struct TwinCamera {
  double noise = 0.0;    // on each axis of each joint, standard deviation [m]
  double latency = 0.0;  // from picture to message, to the nearest tick [s]
  double unseen = 0.0;   // share of pictures without an estimate
  double jumps = 0.0;    // share of pictures in which somebody else is taken for the person, 1 m aside
  std::uint64_t seed = 1;
};
// Throws std::invalid_argument naming the word: "noise=0.02,latency=0.1,unseen=0.05,jumps=0.01", each once at most.
TwinCamera parse_twin_camera(const std::string& text);
// A person who is where the clip has them, as an estimator sees them 30 times a second.
PartnerSource partner_of_clip(PointTracks partner, const TwinCamera& camera = {});

// A person who can be touched, beside a twin in this process.
struct SolidPerson {
  HumanBody body;
  ContactLimits limits;  // that the contacts are held against
};

struct GuardedEpisode {
  OdometrySource odometry = OdometrySource::kTwin;
  HardwareLimits limits;
  LeastSteps least_steps = {};  // of the walking controller: RootVelocity
  std::vector<int> joints;      // that the guard's limiter moves: what is executed of the reference beside the root
  std::optional<SolidPerson> solid = {};
  PartnerSource person = {};    // empty: the guard hears of nobody
  bool perceives = false;       // the policy sees the person whom the guard tracks, and nobody else; without one the
                                // episode does not begin, and one who is lost stays where they were last seen
  bool records_seen = false;    // and so does the recording: nobody knows better
  bool keeps_distance = false;  // the guard minds the person, who comes near once the robot runs: until then it
                                // would not even stand up beside them
  double most_wait = 30.0;      // for the guard to run, by its clock [s]
  std::function<void(const GuardReport&)> watch = {};  // of each change of state, for displays
};

class GuardedWorld final : public World {
 public:
  // Throws as RootVelocity does; std::invalid_argument for a solid person where the link has no twin with an engine in
  // this process. Refers to the link.
  GuardedWorld(GuardedEpisode episode, std::shared_ptr<const RobotModel> robot, GuardLink& link);
  GuardedWorld(const GuardedWorld&) = delete;  // the twin's steps refer to it
  GuardedWorld& operator=(const GuardedWorld&) = delete;
  ~GuardedWorld() override;

  // Plans to stand until the guard runs. Throws std::runtime_error, with what the guard is at, where it does not in
  // most_wait of its time, and where it has gone.
  void begin(const RobotState& start) override;
  [[nodiscard]] const RobotState& state() const override { return state_; }
  // The targets that are sent; for the executed joints those that are asked for, before the limiter.
  const Eigen::VectorXd& target(const Reference& reference) override;
  // A guard that has gone or ended the run is kError, a robot that fell kFell; while it holds, the episode goes on.
  Outcome advance(int tick, const PointTracks& partner, Deadline& deadline) override;
  [[nodiscard]] const HumanJoints* seen_partner() const override { return episode_.perceives ? &seen_ : nullptr; }
  [[nodiscard]] bool records_what_it_sees() const override { return episode_.records_seen; }
  [[nodiscard]] std::string message() const override { return message_; }
  [[nodiscard]] std::span<const Contact> contacts() const override { return contacts_; }  // frame E
  void finish(Rollout& rollout) const override;

  // Plans to stand for so long after the episode [s]; then whoever is next may have the robot.
  void rest(double seconds);

  // Counts over the episode's ticks.
  [[nodiscard]] int unseen_ticks() const { return unseen_ticks_; }  // nobody was tracked
  [[nodiscard]] int held_ticks() const { return held_ticks_; }      // the guard held
  [[nodiscard]] const ClampCounts& clamps() const { return clamps_; }
  [[nodiscard]] int missed_reports() const { return missed_; }         // that were lost between two
  [[nodiscard]] double began_at() const { return began_at_; }          // by the guard's clock [s]
  [[nodiscard]] const GuardReport& report() const { return report_; }  // the last

 private:
  bool next();
  void wait_for_run(const Pose& start);
  void plan(const VelocityCommand& root, const Eigen::VectorXd& q, bool acting);
  void show_person(int tick);
  void move_person(const PointTracks& partner, int tick);
  void take_contacts();
  void take_state();
  void lay_world(const Pose& start);
  [[nodiscard]] Pose to_odometry(const Pose& X_EB) const;
  [[nodiscard]] HumanJoints to_odometry(const HumanJoints& p_E) const;

  GuardedEpisode episode_;
  std::shared_ptr<const RobotModel> robot_;
  GuardLink& link_;
  RootVelocity velocity_;
  FallRule fall_;
  // Pose of the episode's frame E in odometry's frame O: a turn about z and a shift on the ground.
  double yaw_OE_ = 0.0;
  Eigen::Vector3d p_OE_ = Eigen::Vector3d::Zero();
  RobotState state_;  // frame E
  GuardReport report_;
  PlannerMessage message_to_guard_;
  PersonMessage person_;
  HumanJoints seen_ = HumanJoints::Zero();  // by the guard's camera, frame E
  Eigen::VectorXd target_;
  TwinInProcess* twin_ = nullptr;  // where the person is solid
  std::optional<ContactSafety> safety_;
  std::vector<Contact> contacts_;
  int tick_ = 0;
  double stand_off_ = 0.0;  // by which the person is further away than the clip has them [m]
  SafetyState last_state_ = SafetyState::kOffline;
  ClampCounts clamps_before_{}, clamps_{};
  int held_ticks_ = 0, missed_ = 0, unseen_ticks_ = 0;
  double began_at_ = 0.0;
  std::string message_;
};

struct GuardedOptions {
  RobotConfig config;
  bool own_camera = false;  // the guard hears of the person from an estimator; else, beside a twin, from the clip by
  TwinCamera camera = {};
  bool solid = false;             // the person can be touched, beside a twin in this process
  bool policy_sees_clip = false;  // beside a twin: the policy sees the clip's partner in the place of the tracked one
  LeastSteps least_steps = {};    // of the walking controller
  std::string engine;             // that stands in the row: "twin"
  std::string recording;          // path of the recording to make (NPZ); empty: none
  std::function<void(const GuardReport&)> watch = {};
  std::function<bool()> stop_asked = {};
};

struct GuardedRun {
  EpisodeRow row;
  ExecutedMask executed;
  ClampCounts clamps{};
  int held_ticks = 0;                     // in which the guard held
  int unseen_ticks = 0;                   // in which it tracked nobody
  double head_distance = BodyGaps::kFar;  // least of the robot from the person's head and neck [m]
  int missed_reports = 0;                 // of the guard, that were lost on their way
  double guard_seconds = 0;               // of the episode, by the guard's clock [s]
  bool interrupted = false;               // by stop_asked: the row is no result
};

// The episode through `link`, scored as the suite scores. Whatever ends it is an outcome; a guard that does not run is
// `error` with what it is at. Throws StorageError where the recording cannot be written.
GuardedRun run_guarded_episode(const Experiment& experiment, const EpisodeSpec& spec, GuardLink& link,
                               const GuardedOptions& options);

// The same episodes in two worlds, one row each.
struct PairedEpisodes {
  std::vector<EpisodeRow> simulated, guarded;
};

struct PairedSuccess {
  long n = 0, simulated = 0, guarded = 0;
  long both = 0, only_simulated = 0, only_guarded = 0, neither = 0;
  Interval simulated_95, guarded_95;  // Wilson
  Interval difference_95;             // guarded - simulated, Newcombe, paired
  long clips = 0;
  double p = 1.0;       // sign_flip_exact by clip, as on the board
  bool inside = false;  // the guarded share lies in the simulator's interval
};
// Throws std::invalid_argument for lists of different lengths.
PairedSuccess paired_success(const PairedEpisodes& episodes);
std::string paired_text(const PairedSuccess& success, const std::string& simulated, const std::string& guarded);
nlohmann::json paired_json(const PairedSuccess& success);

// A suite of one clip for a robot: `policy` leads from `start` ("act", "approach", ...). Throws as parse_suite.
Suite suite_of_clip(const std::string& clip, const std::string& policy, const std::string& start,
                    const std::string& controller);

}  // namespace duet
