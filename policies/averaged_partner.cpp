#include "duet/policies/averaged_partner.h"

#include <algorithm>
#include <array>
#include <utility>

namespace duet {
namespace {

// Frames that the means of a whole history are taken over.
constexpr int kSpan = 2 * kHistoryFrames - 1;

class AveragedPartner final : public Policy {
 public:
  explicit AveragedPartner(std::unique_ptr<Policy> policy) : policy_(std::move(policy)) {}

  [[nodiscard]] std::string_view name() const override { return policy_->name(); }

  void reset(const EpisodeContext& context) override {
    policy_->reset(context);
    last_tick_ = -kSpan;
  }

  Anchors act(const Observation& observation) override { return policy_->act(averaged(observation)); }
  std::vector<Reference> plan(const Observation& observation) override { return policy_->plan(averaged(observation)); }
  [[nodiscard]] bool corrects() const override { return policy_->corrects(); }
  void correct(const Observation& observation, Reference& reference) override {
    policy_->correct(averaged(observation), reference);
  }
  [[nodiscard]] PolicyFaults faults() const override { return policy_->faults(); }

 private:
  Observation averaged(const Observation& observation) {
    const int fresh = std::clamp(observation.tick - last_tick_, 0, kSpan);
    last_tick_ = observation.tick;
    std::rotate(seen_.begin(), seen_.begin() + fresh, seen_.end());
    for (int i = kSpan - fresh; i < kSpan; ++i) seen_[i] = observation.history.front().partner;
    for (int i = 0; i < kHistoryFrames; ++i) seen_[kSpan - kHistoryFrames + i] = observation.history[i].partner;
    for (int i = 0; i < kHistoryFrames; ++i) {
      shown_[i] = observation.history[i];
      shown_[i].partner.setZero();
      for (int k = i; k < i + kHistoryFrames; ++k) shown_[i].partner += seen_[k] / static_cast<double>(kHistoryFrames);
    }
    return {shown_, observation.tick};
  }

  std::unique_ptr<Policy> policy_;
  std::array<Eigen::Matrix<double, 3, kSmplJoints>, kSpan> seen_;  // oldest first, up to last_tick_
  std::array<ObservationFrame, kHistoryFrames> shown_;
  int last_tick_ = -kSpan;
};

}  // namespace

std::unique_ptr<Policy> with_averaged_partner(std::unique_ptr<Policy> policy) {
  return std::make_unique<AveragedPartner>(std::move(policy));
}

}  // namespace duet
