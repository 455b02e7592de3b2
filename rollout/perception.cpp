#include "duet/rollout/perception.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "duet/core/clock.h"
#include "duet/robots/yaml_range.h"

namespace duet {
namespace {

constexpr Range kTime = {0.0, 600.0, true};

void read_freeze(const YamlSection& section, PerceptionPlan& plan) {
  PerceptionFreeze& freeze = plan.freeze.emplace();
  freeze.at = in_range(section, "at", freeze.at, kTime);
  freeze.duration = in_range(section, "for", freeze.duration, {0.0, 600.0, false});
}

void read_jump(const YamlSection& section, PerceptionPlan& plan) {
  PerceptionJump& jump = plan.jump.emplace();
  jump.at = in_range(section, "at", jump.at, kTime);
  jump.metres = in_range(section, "metres", jump.metres, {0.0, 10.0, false});
}

}  // namespace

const std::vector<PerceptionKind>& perception_kinds() {
  using Plan = PerceptionPlan;
  static const std::vector<PerceptionKind> kinds = {
      {"jitter",
       {"sigma"},
       "the partner's joints are seen with noise [m]",
       [](const YamlSection& at, Plan& plan) {
         plan.jitter = in_range(at, "sigma", 0.02, {0.0, 1.0, false});
       },
       [](const Plan& plan) { return plan.jitter > 0.0 ? fmt::format("{{sigma: {}}}", plan.jitter) : ""; }},
      {"dropout",
       {"p"},
       "a joint of the partner is not seen, with this probability per tick",
       [](const YamlSection& at, Plan& plan) {
         plan.dropout = in_range(at, "p", 0.1, {0.0, 1.0, false});
       },
       [](const Plan& plan) { return plan.dropout > 0.0 ? fmt::format("{{p: {}}}", plan.dropout) : ""; }},
      {"perception_latency",
       {"ms"},
       "the partner is seen as so long ago",
       [](const YamlSection& at, Plan& plan) {
         plan.latency_ms = in_range(at, "ms", 200.0, {0.0, 5000.0, false});
       },
       [](const Plan& plan) { return plan.latency_ms > 0.0 ? fmt::format("{{ms: {}}}", plan.latency_ms) : ""; }},
      {"vanish",
       {"at"},
       "the partner is not seen from then on [s]",
       [](const YamlSection& at, Plan& plan) { plan.vanish = in_range(at, "at", 2.0, kTime); },
       [](const Plan& plan) { return plan.vanish ? fmt::format("{{at: {}}}", *plan.vanish) : ""; }},
      {"freeze",
       {"at", "for"},
       "the partner is seen as at that time for so long [s]",
       read_freeze,
       [](const Plan& plan) {
         return plan.freeze ? fmt::format("{{at: {}, for: {}}}", plan.freeze->at, plan.freeze->duration) : "";
       }},
      {"jump",
       {"at", "metres"},
       "the partner is seen so far from its place from then on",
       read_jump,
       [](const Plan& plan) {
         return plan.jump ? fmt::format("{{at: {}, metres: {}}}", plan.jump->at, plan.jump->metres) : "";
       }}};
  return kinds;
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
