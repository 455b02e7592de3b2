// Calls of the maker's service "sport": numbers, and JSON in a string. Facts: docs/hardware.md,
// "Executors". Pure functions; thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "duet/controllers/root_conversion.h"

namespace duet {

enum class SportCall : std::int64_t {
  kGetFsm = 7001,  // the state of the maker's own machine; read only
  kSetFsm = 7101,
  kSetVelocity = 7105,
};
// States of the maker's machine.
inline constexpr int kFsmDamp = 1, kFsmStart = 500, kFsmWaistStart = 501, kFsmRun = 801;
[[nodiscard]] bool fsm_walks(int fsm);

struct RpcRequest {
  std::int64_t id = 0;  // ours; a response has the same
  SportCall call = SportCall::kGetFsm;
  std::array<char, 96> parameter{};  // JSON, ended by 0
};
// A velocity that ends by itself after `duration` [s]: 0.1 to 0.5, whatever is asked. No allocation.
RpcRequest velocity_request(std::int64_t id, const VelocityCommand& velocity, double duration);
RpcRequest fsm_request(std::int64_t id, int fsm);
RpcRequest read_request(std::int64_t id, SportCall call);

struct RpcResponse {
  std::int64_t id = 0, api = 0;
  std::int32_t code = 0;  // 0: done
  std::string data;       // JSON
};
// The number of {"data": N}; none for anything else.
std::optional<int> fsm_of(std::string_view data);
// An order to a service; none for a parameter that is not of its call.
struct SportOrder {
  VelocityCommand velocity;
  double duration = 0.0;  // [s]
  int fsm = -1;
};
std::optional<SportOrder> order_of(SportCall call, std::string_view parameter);

}  // namespace duet
