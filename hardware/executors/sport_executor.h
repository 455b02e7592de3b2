// The maker's own walking as the executor: velocities that end by themselves go to its service, arm targets to its arm
// topic, whose weight rises slowly. Its balance stays its own. This is not HOMIE, and says so. With a preset action its
// arms are the maker's too: told when the guard begins to run, released when it ends to. One owner, one thread.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "duet/controllers/root_conversion.h"
#include "duet/hardware/executors/executor.h"

namespace duet {

// Calls of the maker's services: numbers, and JSON in a string. Facts: docs/hardware.md, "Executors". Pure functions;
// thread-safe.

// The service "motion_switcher" says which mode of the maker's runs (none: a robot in debug mode), and ends it.
enum class Service { kSport, kMotionSwitcher, kArm };
inline constexpr std::array<std::string_view, 3> kServiceNames = {"sport", "motion_switcher", "arm"};

enum class ServiceCall : std::int64_t {
  kCheckMode = 1001,  // of "motion_switcher"; read only
  kSelectMode = 1002,
  kReleaseMode = 1003,
  kGetFsm = 7001,  // of "sport": the state of the maker's own machine; read only
  kSetFsm = 7101,
  kSetVelocity = 7105,
  kDoArmAction = 7106,  // of "arm" (hardware/executors/arm_action.h)
  kListArmActions = 7107,
};
[[nodiscard]] Service service_of(ServiceCall call);
// States of the maker's machine.
inline constexpr int kFsmDamp = 1, kFsmStart = 500, kFsmWaistStart = 501, kFsmRun = 801;
[[nodiscard]] bool fsm_walks(int fsm);

struct RpcRequest {
  std::int64_t id = 0;  // ours; a response has the same
  ServiceCall call = ServiceCall::kGetFsm;
  std::array<char, 96> parameter{};  // JSON, ended by 0
};
// A velocity that ends by itself after `duration` [s]: 0.1 to 0.5, whatever is asked. No allocation.
RpcRequest velocity_request(std::int64_t id, const VelocityCommand& velocity, double duration);
RpcRequest fsm_request(std::int64_t id, int fsm);
RpcRequest read_request(std::int64_t id, ServiceCall call);
// `action`: a number of hardware/executors/arm_action.h, or kReleaseArm, which ends any.
inline constexpr int kReleaseArm = 99;
RpcRequest action_request(std::int64_t id, int action);

struct RpcResponse {
  std::int64_t id = 0, api = 0;
  std::int32_t code = 0;  // 0: done
  std::string data;       // JSON
};
// The number of {"data": N}; none for anything else.
std::optional<int> fsm_of(std::string_view data);
// The text of {"name": TEXT}; none for anything else.
std::optional<std::string> name_of(std::string_view data);
// An order to a service; none for a parameter that is not of its call.
struct SportOrder {
  VelocityCommand velocity;
  double duration = 0.0;  // [s]
  int fsm = -1;
};
std::optional<SportOrder> order_of(ServiceCall call, std::string_view parameter);

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

// Which mode of the maker's runs and owns the motors, asked of its motion_switcher once a second; read only. One owner,
// one thread.
class ModeWatch {
 public:
  explicit ModeWatch(SportWire& wire) : wire_(wire) {}  // refers to it
  void poll(double now);
  // The last answer: "" where none runs; none where nobody has answered.
  [[nodiscard]] const std::optional<std::string>& mode() const { return mode_; }

 private:
  SportWire& wire_;
  std::optional<std::string> mode_;
  double asked_at_ = kNever;
  std::int64_t next_id_ = 1;
};

class SportExecutor final : public Executor {
 public:
  // `period` of the guard's ticks [s]. `action`: number of a preset arm action (executor `vendor-arm-action`), which
  // takes the place of the arm targets; 0: none.
  SportExecutor(SportWire& wire, double period, int action = 0);
  ~SportExecutor() override;

  void poll(double now) override;
  // The time of the last answer that its machine walks.
  [[nodiscard]] double heard_at() const override { return heard_at_; }
  [[nodiscard]] bool answers() const override { return true; }
  [[nodiscard]] std::string complaint() const override;
  // The maker's own controller may write the low-level topic, and its actions the arm topic; without one that is ours
  // alone.
  int foreign_writers(int) override { return action_ != 0 ? 0 : wire_.arm_writers(); }
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
  int action_;
  bool acts_ = false;  // the action was told, and not released
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
