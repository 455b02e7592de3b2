// A guard, a twin and its operator in this process, one tick after the other: what two processes are over DDS, without
// the wire. The same seed gives the same bits. One owner, one thread.
#pragma once

#include <deque>
#include <memory>

#include "duet/hardware/guard_link.h"
#include "duet/hardware/run_log.h"
#include "duet/hardware/twin_fault.h"
#include "duet/hardware/twin_operator.h"

namespace duet {

class TwinInProcess final : public GuardLink {
 public:
  // Throws as RobotGuard and TwinModel do. `walker` and `log` may be null. The guard is armed as soon as it is ready.
  TwinInProcess(const GuardSetup& setup, const TwinOptions& options, std::unique_ptr<Walker> walker, RunLog* log,
                std::vector<TwinFault> faults = {});

  bool send(const PlannerMessage& message) override;
  bool send(const PersonMessage& message) override;
  bool stop() override;
  bool next(GuardReport& report) override;
  [[nodiscard]] double patience() const override { return 0.0; }
  [[nodiscard]] std::string name() const override { return "the guard of the twin"; }

  [[nodiscard]] const RobotGuard& guard() const { return guard_; }
  [[nodiscard]] TwinModel& twin() { return twin_; }

 private:
  // The transport between guard and twin.
  class Wire final : public FrameTransport {
   public:
    explicit Wire(TwinModel& twin) : twin_(twin) {}
    bool take(LowStateFrame& frame) override;
    int foreign_writers() override { return 0; }
    void open_writer() override { open_ = true; }
    void close_writer() override { open_ = false; }
    [[nodiscard]] bool has_writer() const override { return open_; }
    bool write(const LowCommandFrame& frame) override;
    std::deque<LowStateFrame> states;

   private:
    TwinModel& twin_;
    bool open_ = false;
  };
  class Velocity final : public VelocitySink {
   public:
    explicit Velocity(TwinModel& twin) : twin_(twin) {}
    void send(const VelocityCommand& velocity) override { twin_.obey(velocity); }

   private:
    TwinModel& twin_;
  };
  void tick();

  TwinModel twin_;
  FaultyTwin faulty_;
  TwinOperator operator_;
  Wire wire_;
  Velocity velocity_;
  RobotGuard guard_;
  std::unique_ptr<Walker> walker_;
  RunLog* log_;
};

}  // namespace duet
