#include "duet/hardware/sport_rpc.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace duet {
namespace {

constexpr double kShortest = 0.1, kLongest = 0.5;  // of a velocity [s]
constexpr double kMostVelocity = 10.0;             // that a parameter has room for

// The value within the range of a parameter; 0 where it is not finite.
double printable(double value) { return std::isfinite(value) ? std::clamp(value, -kMostVelocity, kMostVelocity) : 0.0; }

// Parses a document that came from outside; discarded where it is not JSON.
nlohmann::json parsed(std::string_view text) {
  constexpr std::size_t kMostText = 4096;
  if (text.size() > kMostText) return nlohmann::json(nlohmann::json::value_t::discarded);
  return nlohmann::json::parse(text, nullptr, false);
}

std::optional<double> number_at(const nlohmann::json& json, std::string_view key) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_number()) return std::nullopt;
  const double value = found->get<double>();
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

}  // namespace

bool fsm_walks(int fsm) { return fsm == kFsmStart || fsm == kFsmWaistStart || fsm == kFsmRun; }

RpcRequest velocity_request(std::int64_t id, const VelocityCommand& velocity, double duration) {
  RpcRequest request{.id = id, .call = SportCall::kSetVelocity, .parameter = {}};
  const double lasts = std::isfinite(duration) ? std::clamp(duration, kShortest, kLongest) : kShortest;
  fmt::format_to_n(request.parameter.data(), request.parameter.size() - 1,
                   "{{\"velocity\":[{:.4f},{:.4f},{:.4f}],\"duration\":{:.2f}}}", printable(velocity.forward),
                   printable(velocity.lateral), printable(velocity.yaw_rate), lasts);
  return request;
}

RpcRequest fsm_request(std::int64_t id, int fsm) {
  RpcRequest request{.id = id, .call = SportCall::kSetFsm, .parameter = {}};
  fmt::format_to_n(request.parameter.data(), request.parameter.size() - 1, "{{\"data\":{}}}", fsm);
  return request;
}

RpcRequest read_request(std::int64_t id, SportCall call) { return {.id = id, .call = call, .parameter = {}}; }

std::optional<int> fsm_of(std::string_view data) {
  const nlohmann::json json = parsed(data);
  if (!json.is_object()) return std::nullopt;
  const std::optional<double> number = number_at(json, "data");
  if (!number || std::abs(*number) > 1e6 || *number != std::floor(*number)) return std::nullopt;
  return static_cast<int>(*number);
}

std::optional<SportOrder> order_of(SportCall call, std::string_view parameter) {
  const nlohmann::json json = parsed(parameter);
  if (!json.is_object()) return std::nullopt;
  SportOrder order;
  if (call == SportCall::kSetFsm) {
    const std::optional<int> fsm = fsm_of(parameter);
    if (fsm) order.fsm = *fsm;
    return fsm ? std::optional(order) : std::nullopt;
  }
  const auto velocity = json.find("velocity");
  const std::optional<double> duration = number_at(json, "duration");
  if (call != SportCall::kSetVelocity || !duration || velocity == json.end() || !velocity->is_array() ||
      velocity->size() != 3)
    return std::nullopt;
  if (!std::ranges::all_of(*velocity, [](const nlohmann::json& v) { return v.is_number(); })) return std::nullopt;
  order.duration = *duration;
  order.velocity = {velocity->at(0).get<double>(), velocity->at(1).get<double>(), velocity->at(2).get<double>(), 0.0};
  return order;
}

}  // namespace duet
