#include "duet/policies/on_other_body.h"

#include <algorithm>
#include <array>
#include <utility>

#include "duet/core/require.h"
#include "duet/robots/joint_map.h"

namespace duet {
namespace {

class OnOtherBody final : public Policy {
 public:
  OnOtherBody(std::unique_ptr<Policy> policy, std::shared_ptr<const RobotModel> made_for, const RobotModel& body)
      : policy_(std::move(policy)),
        made_for_(std::move(made_for)),
        to_policy_(body.joint_names(), *made_for_),
        to_body_(made_for_->joint_names(), body) {}

  [[nodiscard]] std::string_view name() const override { return policy_->name(); }

  void reset(const EpisodeContext& context) override {
    EpisodeContext moved = context;
    moved.start = to_policy_.state(context.start);
    if (context.hindsight != nullptr) {
      hindsight_ = on_body(*context.hindsight, *made_for_);
      moved.hindsight = &hindsight_;
    }
    policy_->reset(moved);
  }

  Anchors act(const Observation& observation) override {
    Anchors anchors = policy_->act(seen(observation));
    for (Reference& anchor : anchors) anchor.q = to_body_.positions(anchor.q);
    return anchors;
  }

  std::vector<Reference> plan(const Observation& observation) override {
    std::vector<Reference> plan = policy_->plan(seen(observation));
    for (Reference& reference : plan) reference.q = to_body_.positions(reference.q);
    return plan;
  }

  [[nodiscard]] PolicyFaults faults() const override { return policy_->faults(); }

 private:
  Observation seen(const Observation& observation) {
    for (int i = 0; i < kHistoryFrames; ++i)
      history_[i] = {observation.history[i].partner, to_policy_.state(observation.history[i].robot)};
    return {history_, observation.tick};
  }

  std::unique_ptr<Policy> policy_;
  std::shared_ptr<const RobotModel> made_for_;  // shared by the episodes of a run
  JointMap to_policy_, to_body_;
  RobotMotion hindsight_;
  std::array<ObservationFrame, kHistoryFrames> history_;
};

}  // namespace

std::unique_ptr<Policy> on_other_body(std::unique_ptr<Policy> policy, std::shared_ptr<const RobotModel> made_for,
                                      const RobotModel& body) {
  const std::vector<std::string> ours = made_for->joint_names(), theirs = body.joint_names();
  require(std::ranges::any_of(ours,
                              [&](const std::string& name) { return std::ranges::find(theirs, name) != theirs.end(); }),
          "policy '{}': robot '{}' has no joint of robot '{}', which it was made for", policy->name(), body.name,
          made_for->name);
  return std::make_unique<OnOtherBody>(std::move(policy), std::move(made_for), body);
}

}  // namespace duet
