// HOMIE's own two processes as the executor: they hear velocity, height and 14 arm joints over LCM, 50 times a second,
// and alone write to the motors. They notice neither silence nor a wrong sender, so that this side never falls silent
// while it is open, and says goodbye with a velocity of 0. Its policy is heard by what it sends to its controller,
// which goes on with the last targets when the policy dies. No allocation after construction. One owner, one thread.
#pragma once

#include <algorithm>
#include <array>

#include "duet/hardware/executors/executor.h"
#include "duet/hardware/wire/lcm_message.h"

namespace duet {

// The gains of HOMIE's controller for the joints of an arm, shoulder to wrist: nobody can tell it others. Source: its
// g1_control. [N m/rad], [N m s/rad]
inline constexpr std::array<double, 7> kHomieArmStiffness = {150, 150, 150, 100, 10, 10, 5};
inline constexpr std::array<double, 7> kHomieArmDamping = {4, 4, 4, 1, 0.5, 0.5, 0.5};
// Ages of HOMIE's policy, which speaks 50 times a second.
inline constexpr AgeLimits kHomieAges{0.060, 0.120};

class HomieExecutor final : public Executor {
 public:
  // `height`: of the pelvis where it stands [m]. `period` of the guard's ticks [s]. Throws as LcmChannel does.
  HomieExecutor(const LcmPlace& place, double height, double period);
  ~HomieExecutor() override;

  void poll(double now) override;
  // The older of the last words of its controller and of its policy.
  [[nodiscard]] double heard_at() const override { return std::min(echoed_at_, policy_at_); }
  [[nodiscard]] bool answers() const override { return true; }
  [[nodiscard]] std::string complaint() const override;
  // HOMIE's controller is one writer of the low-level topic. More, or somebody else who steers HOMIE, is foreign.
  int foreign_writers(int command_writers) override;
  void open() override { open_ = true; }
  void close() override;
  [[nodiscard]] bool is_open() const override { return open_; }
  bool write(const LowCommandFrame& frame) override;
  void send(const VelocityCommand& velocity) override;

 private:
  void publish(const VelocityCommand& velocity);
  void hear_policy(const PdTargets& targets, double now);

  LcmChannel channel_;
  double height_;
  int ticks_between_;
  LcmBuffer buffer_{};
  ArmAction arms_;
  bool has_arms_ = false;  // before the first targets HOMIE is told none: it keeps its own
  bool open_ = false;
  std::uint32_t sequence_ = 0;
  long ticks_ = 0;
  double echoed_at_ = kNever, policy_at_ = kNever, now_ = kNever;
  double steered_at_ = kNever;  // by others
  std::int64_t stamp_ = -1;     // of the policy's last message
  int writers_ = 0;
};

}  // namespace duet
