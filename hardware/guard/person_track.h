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
  // At `now` - delay - latency of the newest: linear between two estimates, the newest one beyond it. False where the
  // newest picture is older than `most_age` [s].
  bool at(double now, HumanJoints& joints, double most_age = SafetyRules{}.person.hold) const;

 private:
  static constexpr std::size_t kKept = 8;
  struct Kept {
    double at = kNever;
    HumanJoints joints = HumanJoints::Zero();
  };

  double delay_, latency_ = 0.0;
  std::array<Kept, kKept> kept_{};
  std::size_t newest_ = 0;
};

}  // namespace duet
