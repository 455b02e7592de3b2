// The partner as a camera sees them: SMPL joints over a local socket, about 30 times a second, from any estimator. The
// message is documented in docs/hardware.md, "Perception"; time is that of reception, less the latency that the message
// states and what its way took longer than it can. A pure function of what is received, but for PersonInput's socket.
// One owner, one thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "duet/hardware/guard/person_track.h"
#include "duet/hardware/guard/robot_guard.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "duet/hardware/wire/sender_clock.h"

namespace duet {

struct PersonEstimate {
  std::uint64_t sequence = 0;                // rises
  double stamp = 0.0;                        // the sender's clock when the message leaves; constant: none [s]
  bool seen = false;                         // somebody is in the picture
  HumanJoints joints = HumanJoints::Zero();  // SMPL-24, in the camera's frame [m]
  double latency = 0.0;                      // from the picture to this message [s]
};
// A message of the first form, without a latency, has 600 bytes.
inline constexpr std::size_t kPersonBytes = 608, kFirstPersonBytes = 600;
using PersonBuffer = std::array<std::byte, kPersonBytes>;
void encode(const PersonEstimate& estimate, PersonBuffer& buffer);

// Reads a message of either form: kForm, kFinite, kFar, kBody, kLate or kNone; `estimate` is set for kNone alone.
PersonFault decode(std::span<const std::byte> datagram, PersonEstimate& estimate);

// Puts estimates into the frame of odometry, with the pose that the base had when the picture was taken.
class PersonPlacer {
 public:
  explicit PersonPlacer(const CameraMount& camera) : camera_(camera) {}

  // The pose of the base `now`; called every tick.
  void base(const Pose& X_WB, double now);
  // `message` is set for kNone alone.
  PersonFault place(const PersonEstimate& estimate, double now, PersonMessage& message);

 private:
  static constexpr std::size_t kBases = 256;  // half a second of ticks: longer than a pose may be late
  struct Base {
    double at = kNever;
    Pose X_WB;
  };
  [[nodiscard]] Pose base_at(double time) const;

  CameraMount camera_;
  std::array<Base, kBases> bases_{};
  std::size_t newest_ = 0;
  StreamOrder order_;
  SenderDelay way_{true};
  std::uint64_t sequence_ = 0;
};

// The socket of the guard's process.
class PersonInput {
 public:
  PersonInput(DatagramSocket socket, const CameraMount& camera) : socket_(std::move(socket)), placer_(camera) {}

  // Hands what has come to the guard, in the frame of its odometry. Called once a tick.
  void poll(double now, RobotGuard& guard);

 private:
  DatagramSocket socket_;
  PersonPlacer placer_;
  PersonEstimate estimate_;
  PersonMessage message_;
};

}  // namespace duet
