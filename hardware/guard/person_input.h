// The partner as a camera sees them: SMPL joints over a local socket, about 30 times a second, from any estimator. The
// message is documented in docs/hardware.md, "Perception"; time is that of reception. A pure function of what is
// received, but for PersonInput's socket. One owner, one thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "duet/hardware/guard/robot_guard.h"
#include "duet/hardware/wire/datagram_socket.h"

namespace duet {

struct PersonEstimate {
  std::uint64_t sequence = 0;                // rises
  double stamp = 0.0;                        // the sender's clock, for the sender's logs; never used here [s]
  bool seen = false;                         // somebody is in the picture
  HumanJoints joints = HumanJoints::Zero();  // SMPL-24, in the camera's frame [m]
};
inline constexpr std::size_t kPersonBytes = 600;
using PersonBuffer = std::array<std::byte, kPersonBytes>;
void encode(const PersonEstimate& estimate, PersonBuffer& buffer);

// Why an estimate is not used.
enum class PersonFault {
  kNone,
  kForm,    // not such a message
  kFinite,  // a number that is not finite
  kFar,     // a joint further than 20 m from the camera
  kBody,    // a bone longer than 1 m
  kOld,     // a sequence number that does not rise (hardware/wire/datagram_socket.h)
  kUnseen,  // nobody in the picture
};
inline constexpr std::size_t kPersonFaults = 7;
inline constexpr std::array<std::string_view, kPersonFaults> kPersonFaultNames = {"none", "form", "finite", "far",
                                                                                  "body", "old",  "unseen"};
// kForm, kFinite, kFar, kBody or kNone; `estimate` is set for kNone alone.
PersonFault decode(std::span<const std::byte> datagram, PersonEstimate& estimate);

// Turns the received poses into a track in the frame of odometry, which is read 50 times a second.
class PersonTrack {
 public:
  // `X_BC`: of the camera on the robot's base. `delay`: how far behind the present at() looks, so that it lies between
  // two estimates at 30 Hz [s].
  explicit PersonTrack(const Pose& X_BC, double delay = 0.04) : X_BC_(X_BC), delay_(delay) {}

  // `X_WB`: of the base when it was received.
  PersonFault receive(const PersonEstimate& estimate, const Pose& X_WB, double now);
  [[nodiscard]] const HumanJoints& newest() const { return kept_[newest_].joints; }  // frame W
  [[nodiscard]] double newest_at() const { return kept_[newest_].at; }               // kNever: nothing has come
  [[nodiscard]] long restarts() const { return order_.restarts(); }                  // of who estimates
  // At `now` - delay: linear between two estimates, the newest one beyond it. Null where the newest is older than
  // `most_age` [s].
  const HumanJoints* at(double now, double most_age = SafetyRules{}.person.hold);

 private:
  static constexpr std::size_t kKept = 8;
  struct Kept {
    double at = kNever;
    HumanJoints joints = HumanJoints::Zero();
  };

  Pose X_BC_;
  double delay_;
  std::array<Kept, kKept> kept_{};
  std::size_t newest_ = 0;
  StreamOrder order_;
  HumanJoints between_;
};

// The socket of the guard's process.
class PersonInput {
 public:
  PersonInput(DatagramSocket socket, const Pose& X_BC) : socket_(std::move(socket)), track_(X_BC) {}

  // Hands what has come to the guard, in the frame of its odometry. Called once a tick.
  void poll(double now, RobotGuard& guard);
  [[nodiscard]] const PersonTrack& track() const { return track_; }
  [[nodiscard]] long used() const { return used_; }
  [[nodiscard]] const std::array<long, kPersonFaults>& faults() const { return faults_; }

 private:
  DatagramSocket socket_;
  PersonTrack track_;
  PersonEstimate estimate_;
  PersonMessage message_;
  long used_ = 0;
  std::array<long, kPersonFaults> faults_{};
};

}  // namespace duet
