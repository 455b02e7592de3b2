// Stand-ins for programs that run beside a robot: HOMIE's two processes, the maker's services, a camera.
#pragma once

#include <optional>

#include "duet/core/numbers.h"
#include "duet/hardware/executors/sport_executor.h"
#include "duet/hardware/guard/person_input.h"
#include "duet/hardware/wire/lcm_message.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "duet/motion/human_motion.h"

namespace duet {

// A stand-in for HOMIE's two processes, for tests and for `duet-g1-services`: what they take, how they understand it,
// and the defects that whoever steers them has to reckon with - no check of age, order or limits. No policy: the legs
// keep a pose. Facts: docs/hardware.md, "Executors". A pure function of what it is given. One owner, one thread.

// Counts of the messages that came, and their gaps.
struct HomieTraffic {
  long pedals = 0, arms = 0, hands = 0;  // messages
  long refused = 0;                      // of these channels, with another fingerprint or length
  double longest_gap = 0.0;              // between two pedal commands [s]
  double last_pedal = kNever;
};

class FakeHomie {
 public:
  // A datagram of the group.
  void receive(std::span<const std::byte> datagram, double now);
  // The command that its controller writes 200 times a second. Before any arm target the arms go to 0.
  void write_command(std::uint8_t mode_machine, LowCommandFrame& frame);
  // Writes what HOMIE's policy sends to its controller 50 times a second; returns the datagram's length.
  static std::size_t write_targets(double now, std::uint32_t sequence, LcmBuffer& buffer);
  // Writes what HOMIE's controller echoes; returns the datagram's length.
  static std::size_t write_echo(const RobotReading& reading, std::uint32_t sequence, LcmBuffer& buffer);

  [[nodiscard]] const std::array<double, 4>& velocity() const { return velocity_; }  // that it walks with, however old
  [[nodiscard]] const HomieTraffic& traffic() const { return traffic_; }
  [[nodiscard]] bool has_arms() const { return arms_.has_value(); }

 private:
  std::array<double, 4> velocity_{0.0, 0.0, 0.0, 0.74};
  std::optional<ArmAction> arms_;
  HomieTraffic traffic_;
  JointCommand joints_;
};

// A stand-in for the maker's walking service and its arm topic, for tests and for `duet-g1-services`: calls and their
// answers, velocities that end, arms by weight. No gait: the legs keep the stance. Facts: docs/hardware.md,
// "Executors". A pure function of what it is given. One owner, one thread.
class FakeSport {
 public:
  // `stance`: of kG1Motors joints, what it holds itself.
  explicit FakeSport(JointCommand stance, int fsm = kFsmStart);

  RpcResponse answer(const RpcRequest& request, double now);
  // A frame of the arm topic; one with a wrong checksum is counted and not obeyed.
  void obey_arms(const LowCommandFrame& frame);
  // The velocity that it walks with now: 0 once the last order has ended.
  [[nodiscard]] VelocityCommand velocity(double now) const;
  // Writes the command to the motors.
  void write_command(std::uint8_t mode_machine, LowCommandFrame& frame);

  [[nodiscard]] int fsm() const { return fsm_; }
  [[nodiscard]] double arm_weight() const { return weight_; }
  [[nodiscard]] long refused() const { return refused_; }

 private:
  JointCommand stance_, joints_;
  int fsm_;
  SportOrder order_;
  double ordered_at_ = kNever, weight_ = 0.0;
  Eigen::VectorXd arms_, arms_kp_, arms_kd_;
  long refused_ = 0;
};

// A stand-in for the maker's motion_switcher. One owner, one thread.
class FakeSwitcher {
 public:
  // `mode`: that runs at first and is the only one there is; empty: none, as on a robot in debug mode.
  explicit FakeSwitcher(std::string mode = "") : known_(std::move(mode)), runs_(!known_.empty()) {}
  RpcResponse answer(const RpcRequest& request);
  // Whether a mode runs: the service of one that was released is silent, and its motors are limp.
  [[nodiscard]] bool runs() const { return runs_; }

 private:
  std::string known_;
  bool runs_;
};

// A stand-in for a camera and its estimator: a person of a clip, seen with noise. Deterministic by its seed. One owner,
// one thread.

struct PersonPlay {
  double rate = 30.0;    // estimates a second
  double noise = 0.02;   // on each axis of each joint, standard deviation [m]
  double unseen = 0.0;   // share of estimates without anybody
  double latency = 0.0;  // that the messages state [s]
  std::uint64_t seed = 1;
};

class PersonPlayer {
 public:
  // `X_WB`: where the robot's base stands in the clip; it is taken to stay there. `X_BC`: of the camera on the base.
  // Throws std::invalid_argument for a rate that is not above 0, a negative noise, a share outside 0 to 1.
  PersonPlayer(const HumanMotion& person, const Pose& X_WB, const Pose& X_BC, const PersonPlay& play);

  // The next estimate, or false at the clip's end.
  bool next(PersonEstimate& estimate);
  [[nodiscard]] int frames() const { return person_.frames(); }  // estimates of the clip

 private:
  HumanMotion person_;  // at the rate of the estimates
  Pose X_CW_;
  PersonPlay play_;
  Random random_;
  int frame_ = 0;
};

// Where a robot that replaces this person stands at first: the pelvis over the ground, turned as the person is.
Pose base_of_reactor(const HumanMotion& reactor, double height);

}  // namespace duet
