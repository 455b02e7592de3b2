#include "bench/perception.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "bench/yaml_range.h"
#include "core/clock.h"

namespace duet {
namespace {

constexpr double kDefaultJitter = 0.02, kDefaultDropout = 0.1, kDefaultPerceptionLatency = 200.0, kDefaultVanish = 2.0;
constexpr Range kTime = {0.0, 600.0, true};

}  // namespace

const std::vector<std::string>& perception_kinds() {
  static const std::vector<std::string> kinds = {"jitter", "dropout", "perception_latency", "vanish", "freeze", "jump"};
  return kinds;
}

PerceptionPlan read_perception(const YamlSection& item, const std::string& file) {
  PerceptionPlan plan;
  const auto below = [&](const char* kind, std::initializer_list<const char*> keys) {
    return YamlSection(file, item.node(kind), kind, keys);
  };
  if (item.has("jitter"))
    plan.jitter = in_range(below("jitter", {"sigma"}), "sigma", kDefaultJitter, {0.0, 1.0, false});
  if (item.has("dropout")) plan.dropout = in_range(below("dropout", {"p"}), "p", kDefaultDropout, {0.0, 1.0, false});
  if (item.has("perception_latency"))
    plan.latency_ms =
        in_range(below("perception_latency", {"ms"}), "ms", kDefaultPerceptionLatency, {0.0, 5000.0, false});
  if (item.has("vanish")) plan.vanish = in_range(below("vanish", {"at"}), "at", kDefaultVanish, kTime);
  if (item.has("freeze")) {
    const YamlSection freeze = below("freeze", {"at", "for"});
    plan.freeze = PerceptionFreeze();
    plan.freeze->at = in_range(freeze, "at", plan.freeze->at, kTime);
    plan.freeze->duration = in_range(freeze, "for", plan.freeze->duration, {0.0, 600.0, false});
  }
  if (item.has("jump")) {
    const YamlSection jump = below("jump", {"at", "metres"});
    plan.jump = PerceptionJump();
    plan.jump->at = in_range(jump, "at", plan.jump->at, kTime);
    plan.jump->metres = in_range(jump, "metres", plan.jump->metres, {0.0, 10.0, false});
  }
  return plan;
}

std::vector<std::string> yaml_parts(const PerceptionPlan& plan) {
  std::vector<std::string> parts;
  if (plan.jitter > 0.0) parts.push_back(fmt::format("jitter: {{sigma: {}}}", plan.jitter));
  if (plan.dropout > 0.0) parts.push_back(fmt::format("dropout: {{p: {}}}", plan.dropout));
  if (plan.latency_ms > 0.0) parts.push_back(fmt::format("perception_latency: {{ms: {}}}", plan.latency_ms));
  if (plan.vanish) parts.push_back(fmt::format("vanish: {{at: {}}}", *plan.vanish));
  if (plan.freeze) parts.push_back(fmt::format("freeze: {{at: {}, for: {}}}", plan.freeze->at, plan.freeze->duration));
  if (plan.jump) parts.push_back(fmt::format("jump: {{at: {}, metres: {}}}", plan.jump->at, plan.jump->metres));
  return parts;
}

Perception::Perception(const PerceptionPlan& plan, std::uint64_t seed)
    : plan_(plan),
      jitter_(seed, stream_key({"perception", "jitter"})),
      dropout_(seed, stream_key({"perception", "dropout"})),
      past_(static_cast<std::size_t>(ticks_of(plan.latency_ms / 1000.0)) + 1) {
  if (!plan_.jump) return;
  const double angle = 2.0 * std::numbers::pi * Random(seed, stream_key({"perception", "jump"})).uniform();
  jump_ = plan_.jump->metres * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
}

// The draws of a tick do not depend on whether the partner is seen: two plans with one seed have the same noise.
const Perception::Joints& Perception::seen(int tick, const Joints& partner) {
  if (tick == 0) std::fill(past_.begin(), past_.end(), partner);
  measure(tick, delayed(partner));
  return seen_;
}

bool Perception::held(int tick) const {
  if (tick == 0) return false;  // a first look there is
  if (plan_.vanish && tick >= ticks_of(*plan_.vanish)) return true;
  return plan_.freeze && tick >= ticks_of(plan_.freeze->at) &&
         tick < ticks_of(plan_.freeze->at) + ticks_of(plan_.freeze->duration);
}

const Perception::Joints& Perception::delayed(const Joints& partner) {
  newest_ = (newest_ + 1) % past_.size();
  past_[newest_] = partner;
  return past_[(newest_ + 1) % past_.size()];  // the oldest
}

void Perception::measure(int tick, const Joints& partner) {
  const bool jumped = plan_.jump && tick >= ticks_of(plan_.jump->at);
  const bool holds = held(tick);
  for (int j = 0; j < static_cast<int>(partner.cols()); ++j) {
    Eigen::Vector3d p_W = partner.col(j);
    if (jumped) p_W += jump_;
    if (plan_.jitter > 0.0)
      for (double& x : p_W) x += plan_.jitter * jitter_.normal();
    const bool dropped = plan_.dropout > 0.0 && dropout_.chance(plan_.dropout);
    if (!holds && (tick == 0 || !dropped)) seen_.col(j) = p_W;
  }
}

}  // namespace duet
