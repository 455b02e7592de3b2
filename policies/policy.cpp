#include "duet/policies/policy.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <utility>

#include "duet/core/require.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

bool is_finite(const ObservationFrame& frame) {
  const RobotState& robot = frame.robot;
  return frame.partner.allFinite() && robot.X_WB.p.allFinite() && robot.X_WB.R.coeffs().allFinite() &&
         robot.v_WB.allFinite() && robot.w_WB_B.allFinite() && robot.q.allFinite() && robot.v.allFinite();
}

}  // namespace

std::vector<Reference> leave_out(PolicyFaults& faults, std::string_view policy, int tick, std::string_view problem) {
  ++faults.invalid;
  if (faults.message.empty()) faults.message = fmt::format("policy '{}': tick {}: {}", policy, tick, problem);
  return {};
}

void require_known_task(std::string_view policy, std::span<const Task> known, Task task) {
  if (std::ranges::find(known, task) != known.end()) return;
  throw MissingError(fmt::format("policy '{}' was not made for the task '{}': it knows {}", policy, to_string(task),
                                 fmt::join(task_names(known), ", ")));
}

bool is_finite(const Observation& observation) {
  return std::ranges::all_of(observation.history, [](const ObservationFrame& frame) { return is_finite(frame); });
}

Eigen::Vector4d wxyz_of(const Eigen::Quaterniond& R) {
  const double sign = R.w() < 0.0 ? -1.0 : 1.0;
  return sign * Eigen::Vector4d(R.w(), R.x(), R.y(), R.z());
}

Eigen::VectorXd to_vector(const ObservationFrame& frame, const Eigen::Vector3d& start_position) {
  const RobotState& robot = frame.robot;
  const Eigen::Matrix3d R_BW = robot.X_WB.R.conjugate().toRotationMatrix();
  Eigen::VectorXd vector(3 + frame.partner.size() + 9 + robot.q.size() + robot.v.size() + 7);
  vector << frame.partner.col(0), frame.partner.reshaped(), R_BW * robot.v_WB, robot.w_WB_B,
      R_BW * -Eigen::Vector3d::UnitZ(), robot.q, robot.v, robot.X_WB.p - start_position, wxyz_of(robot.X_WB.R);
  return vector;
}

std::vector<Reference> Policy::plan(const Observation& observation) { return densify(act(observation)); }

std::vector<Reference> densify(const Anchors& anchors) {
  constexpr int kGrid = (kAnchors - 1) * kTicksPerAnchor;
  std::vector<Reference> dense;
  dense.reserve(kGrid);
  for (int i = 0; i < kGrid; ++i) {
    const Reference& a = anchors[static_cast<std::size_t>(i / kTicksPerAnchor)];
    const Reference& b = anchors[static_cast<std::size_t>(i / kTicksPerAnchor) + 1];
    const double s = static_cast<double>(i % kTicksPerAnchor) / kTicksPerAnchor;
    dense.push_back(interpolate(a, b, s));
  }
  return dense;
}

Reference interpolate(const Reference& a, const Reference& b, double s) {
  if (s == 0.0) return a;  // exactly: slerp rounds
  return {interpolate(a.X_WB, b.X_WB, s), a.q + s * (b.q - a.q)};
}

void ObservationHistory::add(const ObservationFrame& frame) {
  if (empty_) {
    frames_.fill(frame);
    empty_ = false;
    return;
  }
  std::rotate(frames_.begin(), frames_.begin() + 1, frames_.end());
  frames_.back() = frame;
}

Observation ObservationHistory::at(int tick) const {
  require(!empty_, "observation history: no frame was added yet");
  return {frames_, tick};
}

Eigen::MatrixXd to_matrix(const Observation& observation, const Eigen::Vector3d& start_position) {
  require(!observation.history.empty(), "observation: expected a history, found none");
  Eigen::MatrixXd matrix;
  for (std::size_t i = 0; i < observation.history.size(); ++i) {
    const Eigen::VectorXd column = to_vector(observation.history[i], start_position);
    if (i == 0) matrix.resize(column.size(), static_cast<Eigen::Index>(observation.history.size()));
    matrix.col(static_cast<Eigen::Index>(i)) = column;
  }
  return matrix;
}

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

  [[nodiscard]] bool corrects() const override { return policy_->corrects(); }

  void correct(const Observation& observation, Reference& reference) override {
    Reference moved{reference.X_WB, to_policy_.positions(reference.q)};
    const Eigen::VectorXd before = moved.q;
    policy_->correct(seen(observation), moved);
    reference.X_WB = moved.X_WB;
    reference.q += to_body_.rates(moved.q - before);
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
