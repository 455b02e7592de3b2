// Demonstrations for D-STAR: synthesised clips through PAIR and A.4.4, seen as the robot would follow them exactly and
// as it followed them in an engine. No suite that ships draws its clips from these seeds (a test of ShippedSuites).
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/experiment/suite/suite.h"
#include "duet/experiment/work/run_work.h"
#include "duet/motion/paired_motion.h"
#include "duet/policies/phase_adaptation.h"
#include "duet/policies/policy.h"
#include "duet/retarget/options.h"
#include "duet/robots/robot_model.h"
#include "duet/training/dstar/demonstrations.h"

namespace duet {

struct DemonstrationClips {
  Likeness like = Likeness::kScripted;
  int per_task = 0;
};

struct DemonstrationOptions {
  std::vector<DemonstrationClips> clips = {{Likeness::kScripted, 80}, {Likeness::kPeople, 400}};
  std::uint64_t seed = 880001;
  std::string retargeting = "best";        // parse_retargeting
  int starts = 2;                          // of each clip, drawn as A.4.4 has it
  StartMode start = StartMode::kApproach;  // or kSimToReal: Algorithm 7, whose starts are all the same
  bool answers = false;                    // it comes early and waits, and begins after its partner (kApproach)
  bool leads = false;                      // with `answers`: but half of the gestures are its to begin
  int followed = 200;  // clips of each kind and task whose first start is also followed in the engine
  std::string engine = "mujoco", controller = "wbc_sim";  // empty engine: kinematic only
  std::string controller_network;                         // its option `network`; empty: the one it has by itself
  int threads = 1;
  // The actor: the demonstration itself, also seen as it is, or a policy, on the clips that are followed; then the
  // robot is seen where the policy takes it, and what it was meant to do stays (DAgger: Ross et al. 2011).
  std::string policy = "replay";
  PolicyOptions policy_options = {};
};

inline constexpr std::uint64_t kDemonstrationSeed = 880001, kValidationSeed = 890001;

// "best w-kin=8": a mode of PAIR and options after it (docs/retargeting.md). Throws std::invalid_argument as
// make_pair_options does.
PairOptions parse_retargeting(const std::string& text);

// "80 clips of each task and 400 like people (seed 880001), retargeted by best, 2 starts of each, up to 200 of a kind
// followed in mujoco under wbc_sim by replay".
std::string origin_of(const DemonstrationOptions& options);

// A rollout in which the robot fell is kept up to a second before the fall, and dropped where less than two seconds are
// left. Returns nothing where `stop` said so in between. Throws what prepare_clips and make_controller throw, and
// MissingError for an engine that is not there.
std::optional<DemonstrationSet> make_demonstrations(const std::shared_ptr<const RobotModel>& robot,
                                                    const DemonstrationOptions& options, Progress& progress,
                                                    const std::function<bool()>& stop);

// Frames, at most a second, by which the robot did the act later than it was meant to: those at which its upper body is
// nearest to the meant one. 0 for a robot that did nothing.
int act_lag(const AdaptedMotion& meant, const std::vector<RobotState>& did, const RobotModel& robot);
// The act and what follows so many frames later; the robot goes on waiting until then. A robot that acts late is not
// asked to be done at the time that was meant: that would teach it to leave the act out.
AdaptedMotion put_off(const AdaptedMotion& meant, int frames);

// The partner goes on waiting: frames before he begins, or all where he does not, to and fro.
PairedMotion with_waiting_partner(const PairedMotion& clip);
// The act of a motion that comes early and waits, done as soon as the robot is there and again until the end, half a
// second apart. Its phases are those of all of them together.
AdaptedMotion begun_at_once(const AdaptedMotion& waits);

// "digest  clip_id" of every clip of a suite, with a first line that says which: the content of a test split.
std::string split_text(const Suite& suite, int threads, Progress& progress);

// Motions for a controller to learn on: synthesised clips of the six tasks through PAIR, with the approach of A.4.4.
// No suite that ships draws its clips from this seed (a test of ShippedSuites).

inline constexpr std::uint64_t kTrainingSeed = 770001;

std::vector<RobotMotion> training_motions(const RobotModel& robot, int per_task, int threads, Progress& progress);

}  // namespace duet
