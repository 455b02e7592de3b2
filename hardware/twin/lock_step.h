// Guard and twin in lock-step: the twin takes its next step when the command for the last one has come, and the guard's
// clock has a period for each of its states. The tick travels in the command's first reserved word, which is 0 on a
// robot's wire. On a machine that is busy with other things an episode is then the same as on one that is not; nothing
// here holds a robot's time.
#pragma once

#include <deque>
#include <functional>
#include <memory>

#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/log/run_log.h"
#include "duet/hardware/twin/twin_operator.h"

namespace duet {

// A twin's wire on the guard's side. A state that comes again was not answered, or the answer was lost: the last
// command is sent again. One owner, one thread.
class LockStepWire final : public RobotWire {
 public:
  explicit LockStepWire(RobotWire& wire) : wire_(wire) {}

  // Waits for the twin's next state, for at most so long [s]; false where none came.
  bool wait(double seconds) override;

  bool take(LowStateFrame& frame) override;
  bool take(OdometrySample& sample) override { return wire_.take(sample); }
  bool take(BatteryReading& reading) override { return wire_.take(reading); }
  double executor_heard(double now) override { return wire_.executor_heard(now); }
  int foreign_writers() override { return wire_.foreign_writers(); }
  void open_writer() override { wire_.open_writer(); }
  void close_writer() override;
  [[nodiscard]] bool has_writer() const override { return wire_.has_writer(); }
  bool write(const LowCommandFrame& frame) override;

 private:
  RobotWire& wire_;
  LowStateFrame state_{};
  LowCommandFrame answer_{};
  bool waits_ = false, answered_ = false;  // a state is there to be taken; `answer_` is to the last one
  std::uint32_t tick_ = 0;
};

// As run_guard does, but a tick for every state. After each report (kReportEvery ticks, `report` says
// whether one went out) it waits for the planner's message, so that a slow planner costs nothing.
struct LockStepCallbacks {
  std::function<bool(double now)> go_on;  // after each tick, with the guard's time
  std::function<bool()> report = {};      // after each tick
};
void run_guard_in_lock_step(RobotGuard& guard, LockStepWire& wire, DatagramSocket* planner, double period,
                            const LockStepCallbacks& callbacks);

// The twin's side: whether the command that answers its last state has come, or nobody answers. One owner, one thread.
class LockStepTwin {
 public:
  explicit LockStepTwin(TwinWire& wire) : wire_(wire) {}
  // After `state` was written: takes commands, handing each new one to `obey`, until its answer is there. It writes the
  // state again where none comes, and gives up after ten seconds or where nobody writes commands any more: then the
  // twin is on its own, at the wall's pace.
  // False where nobody answers in lock-step (yet, or any more).
  bool await(const LowStateFrame& state, const std::function<void(const LowCommandFrame&)>& obey);

 private:
  TwinWire& wire_;
  bool locked_ = false;
};

// Troubles between guard and twin that are none of the twin's states (TwinFault).
struct TwinTrouble {
  int foreign_writers = 0;
  bool odometry = true;                            // is heard
  double jump = 0.0;                               // of odometry, along x [m]
  bool writes = true;                              // commands leave
  std::function<void(LowStateFrame&)> spoil = {};  // of each state, before its checksum
};

// A guard, a twin and its operator in this process, one tick after the other: what two processes are over DDS, without
// the wire. The same seed gives the same bits. One owner, one thread.
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
  TwinInProcess* in_process() override { return this; }

  // The twin goes on, and nobody ticks the guard.
  void pause(double seconds);

  [[nodiscard]] const RobotGuard& guard() const { return guard_; }
  [[nodiscard]] RobotGuard& guard() { return guard_; }
  [[nodiscard]] TwinModel& twin() { return twin_; }
  [[nodiscard]] TwinOperator& operated() { return operator_; }
  TwinTrouble trouble;
  std::function<void()> after_step = {};  // of the twin

 private:
  // The transport between guard and twin.
  class Wire final : public FrameTransport {
   public:
    Wire(TwinModel& twin, const TwinTrouble& trouble) : twin_(twin), trouble_(trouble) {}
    bool take(LowStateFrame& frame) override;
    int foreign_writers() override { return trouble_.foreign_writers; }
    void open_writer() override { open_ = true; }
    void close_writer() override { open_ = false; }
    [[nodiscard]] bool has_writer() const override { return open_; }
    bool write(const LowCommandFrame& frame) override;
    std::deque<LowStateFrame> states;

   private:
    TwinModel& twin_;
    const TwinTrouble& trouble_;
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
  void step_twin();

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
