// The maker's own walking as the executor: velocities that end by themselves go to its service, arm targets to its arm
// topic, whose weight rises slowly. Its balance stays its own. This is not HOMIE, and says so. One owner, one thread.
#pragma once

#include "duet/hardware/executor.h"
#include "duet/hardware/sport_rpc.h"

namespace duet {

// The topics of the maker's services, as a client sees them; hardware/dds/ has them over DDS.
class SportWire {
 public:
  virtual ~SportWire() = default;
  // The next response that has arrived; false where there is none.
  virtual bool take(RpcResponse& response) = 0;
  virtual bool request(const RpcRequest& request) = 0;
  // How many others write the arm topic now.
  virtual int arm_writers() = 0;
  virtual void open_arms() = 0;
  virtual void close_arms() = 0;
  virtual bool write_arms(const LowCommandFrame& frame) = 0;
};

class SportExecutor final : public Executor {
 public:
  // `period` of the guard's ticks [s].
  SportExecutor(SportWire& wire, double period);
  ~SportExecutor() override;

  void poll(double now) override;
  // The time of the last answer that its machine walks.
  [[nodiscard]] double heard_at() const override { return heard_at_; }
  [[nodiscard]] bool answers() const override { return true; }
  [[nodiscard]] std::string complaint() const override;
  // The maker's own controller may write the low-level topic; the arm topic is ours alone.
  int foreign_writers(int) override { return wire_.arm_writers(); }
  void open() override;
  void close() override;
  [[nodiscard]] bool is_open() const override { return open_; }
  bool write(const LowCommandFrame& frame) override;
  void send(const VelocityCommand& velocity) override;
  // Once it has moved, damping and a fault ask the service to damp, until it says that it does.
  void enter(SafetyState state) override;

  [[nodiscard]] double arm_weight() const { return weight_; }  // 0 to 1

 private:
  void hear(const RpcResponse& response, double now);
  [[nodiscard]] bool every(double seconds) const;

  SportWire& wire_;
  double period_;
  LowCommandFrame frame_{};
  VelocityCommand sent_;
  SafetyState state_ = SafetyState::kOffline;
  std::int64_t next_id_ = 1;
  bool open_ = false, has_arms_ = false, moved_ = false;
  double weight_ = 0.0, heard_at_ = kNever, asked_at_ = kNever;
  int fsm_ = -1;  // -1: not known
  std::int32_t last_refusal_ = 0;
  long ticks_ = 0;
};

}  // namespace duet
