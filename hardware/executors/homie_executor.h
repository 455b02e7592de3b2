// HOMIE's own two processes as the executor: they hear velocity, height and 14 arm joints over LCM, 50 times a second,
// and alone write to the motors. They notice neither silence nor a wrong sender, so that this side never falls silent
// while it is open, and says goodbye with a velocity of 0. No allocation after construction. One owner, one thread.
#pragma once

#include "duet/hardware/executors/executor.h"
#include "duet/hardware/wire/lcm_message.h"

namespace duet {

class HomieExecutor final : public Executor {
 public:
  // `height`: of the pelvis where it stands [m]. `period` of the guard's ticks [s]. Throws as LcmChannel does.
  HomieExecutor(const LcmPlace& place, double height, double period);
  ~HomieExecutor() override;

  void poll(double now) override;
  [[nodiscard]] double heard_at() const override { return heard_at_; }
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

  LcmChannel channel_;
  double height_;
  int ticks_between_;
  LcmBuffer buffer_{};
  ArmAction arms_;
  bool has_arms_ = false;  // before the first targets HOMIE is told none: it keeps its own
  bool open_ = false;
  std::uint32_t sequence_ = 0;
  long ticks_ = 0;
  double heard_at_ = kNever, steered_at_ = kNever, now_ = kNever;  // by others
  int writers_ = 0;
};

}  // namespace duet
