// A person as a camera's estimator has them: one estimate in the frame of odometry, why another was refused, and the
// track that a policy looks at 50 times a second. Pure functions of what is received; no allocation.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "duet/backends/backend.h"
#include "duet/core/recording.h"
#include "duet/hardware/safety/safety_machine.h"

namespace duet {

// The partner's joints in the frame of odometry, as somebody estimated them.
struct PersonMessage {
  std::uint64_t sequence = 0;
  HumanJoints joints = HumanJoints::Zero();  // where they were when the picture was taken [m]
  double latency = 0.0;                      // from the picture to the message [s]
  long sender_restarts = 0;                  // of who estimates, that whoever took the estimates noticed
};

// Where a camera sits.
struct CameraMount {
  Pose X_BC;             // on the robot's base
  double latency = 0.0;  // of its own, that no message states; added to theirs [s]
};

// Why an estimate is not used.
enum class PersonFault {
  kNone,
  kForm,    // not such a message
  kFinite,  // a number that is not finite
  kFar,     // a joint further than 20 m from the camera
  kBody,    // a bone longer than 1 m
  kOld,     // a number that does not rise (hardware/wire/datagram_socket.h), or a picture from before the last one
  kUnseen,  // nobody in the picture
  kLate,    // its picture is older than a person's pose may be
  kJump,    // somebody who was elsewhere a moment ago
};
inline constexpr std::size_t kPersonFaults = 9;
inline constexpr std::array<std::string_view, kPersonFaults> kPersonFaultNames = {
    "none", "form", "finite", "far", "body", "old", "unseen", "late", "jump"};
// How many estimates met each; those without a fault were used.
using PersonCounts = std::array<long, kPersonFaults>;

// Refused: all but those that were used and those without anybody.
long refused_estimates(const PersonCounts& counts);
// "estimates: 120 used, 0 without anybody, 31 refused: 30 far (a joint further than 20 m from the camera), 1 body
// (...)";
// "" where none came.
std::string person_counts_text(const PersonCounts& counts);

// Turns the estimates into poses 50 times a second, in the frame of odometry.
class PersonTrack {
 public:
  // `delay`: how far behind their latency at() looks, so that it lies between two estimates at 30 Hz [s].
  explicit PersonTrack(double delay = 0.04) : delay_(delay) {}

  // Joints as they were at `exposed_at`, later than those before.
  void add(const HumanJoints& joints, double exposed_at, double received_at);
  [[nodiscard]] const HumanJoints& newest() const { return kept_[newest_].joints; }
  [[nodiscard]] double newest_at() const { return kept_[newest_].at; }  // of its picture; kNever: nothing has come
  // How fast their pelvis moves over the ground [m/s]: the slope of the last 0.4 s, which an estimator's noise hardly
  // moves, or where it is larger that of the last 0.12 s less kShortNoise, by which somebody who starts is noticed. The
  // first pictures are taken at their word. 0 for one.
  [[nodiscard]] double speed() const;
  // At `now` - delay - latency of the newest: linear between two estimates, the newest one beyond it. False where the
  // newest picture is older than `most_age` [s].
  bool at(double now, HumanJoints& joints, double most_age = SafetyRules{}.person.hold) const;

 private:
  static constexpr std::size_t kKept = 16;
  static constexpr double kShortNoise = 0.6;  // twice what 2 cm of noise make of four pictures [m/s]
  struct Kept {
    double at = kNever;
    HumanJoints joints = HumanJoints::Zero();
  };

  [[nodiscard]] double slope(double seconds) const;

  double delay_, latency_ = 0.0;
  std::array<Kept, kKept> kept_{};
  std::size_t newest_ = 0;
};

// Whether a person takes part in the act that a planner asks for: they are near and have been calm for a moment. The
// touches of the task are allowed only while they do. It is measured: a planner's word is not enough, and lasts no
// longer than an act.
class Engagement {
 public:
  static constexpr double kNear = 2.5;      // from the robot's root to their pelvis [m]
  static constexpr double kCalm = 0.8;      // a slow walk [m/s]
  static constexpr double kHurried = 1.2;   // which ends it [m/s]
  static constexpr double kCalmTime = 0.3;  // [s]
  static constexpr double kLongest = 30.0;  // then the planner has to stop asking first [s]

  // Once a tick. `asks`: the planner, about a person whose place is known. `apart` [m], `speed` [m/s], `now` rises [s].
  void update(bool asks, double apart, double speed, double now);
  [[nodiscard]] bool engaged() const { return engaged_; }

 private:
  bool engaged_ = false;
  double since_ = kNever;  // of the asking [s]; kNever: nobody asks
  double calm_since_ = kNever;
};

}  // namespace duet
