#include "duet/rollout/audit/controller_audit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace duet {
namespace {

constexpr double kAsymmetryShare = 0.05;  // of the asymmetry in a reading's cost
constexpr double kLeastGain = 0.08;       // by which a reading has to be better than the descriptor
constexpr double kMostCostShare = 0.7;  // of the descriptor's cost; both are from the slips and networks of audit_sweep
constexpr double kOneSidedShare = 0.95;  // of the asymmetry that a one-sided reading may leave

}  // namespace

double ReadingScore::cost() const {
  double sum = 0.0;
  for (const double cost : costs) sum += cost;
  return sum / static_cast<double>(std::max<std::size_t>(costs.size(), 1)) +
         kAsymmetryShare * std::min(asymmetry / 1.4, 1.0);
}

namespace {

class Search {
 public:
  Search(const AuditSubject& subject, const std::string& engine)
      : subject_(subject), ground_(engine, subject.robot, subject.physics.dt) {
    for (const DescriptorJoint& joint : subject.descriptor.joints)
      if (!joint.action) posture_[joint.name] = joint.neutral;
  }

  ReadingSearch run() {
    ReadingSearch found;
    found.tasks = trial_tasks(subject_.descriptor);
    found.own.asymmetry = asymmetry(subject_.descriptor, *subject_.robot, subject_.make);
    for (const TrialTask& task : found.tasks) add_trial(subject_.descriptor, task, found.own);
    order_by_cost(found.own.costs);
    for (const Reading& reading : other_readings(subject_.descriptor, *subject_.robot)) try_reading(reading, found);
    std::ranges::stable_sort(found.better, {}, &NamedDefect::cost);
    return found;
  }

 private:
  void add_trial(const Descriptor& descriptor, const TrialTask& task, ReadingScore& score) {
    const bool told = descriptor.command.has_value();
    const auto controller =
        subject_.make(descriptor, told ? ControllerOptions{{"command", task.command()}} : ControllerOptions{});
    score.trials.push_back(ground_.run(*controller, task, posture_));
    score.costs.push_back(trial_cost(task, score.trials.back()));
  }

  // The costliest task first: that is where another reading shows soonest that it is no better.
  void order_by_cost(const std::vector<double>& costs) {
    order_.resize(costs.size());
    std::iota(order_.begin(), order_.end(), std::size_t{0});
    std::ranges::stable_sort(order_, [&](std::size_t a, std::size_t b) { return costs[a] > costs[b]; });
  }

  // Trials one after another, as long as it stays up and is better than the descriptor by so much a trial.
  void try_reading(const Reading& reading, ReadingSearch& found) {
    ++found.tried;
    ReadingScore score;
    if (reading.one_sided) {
      score.asymmetry = asymmetry(reading.descriptor, *subject_.robot, subject_.make);
      if (score.asymmetry > kOneSidedShare * found.own.asymmetry) return;
    }
    double gain = 0.0;
    for (const std::size_t task : order_) {
      add_trial(reading.descriptor, found.tasks[task], score);
      gain += found.own.costs[task] - score.costs.back();
      if (!score.trials.back().upright || gain < kLeastGain * static_cast<double>(score.costs.size())) return;
    }
    score.asymmetry = asymmetry(reading.descriptor, *subject_.robot, subject_.make);
    if (found.own.cost() - score.cost() < kLeastGain || score.cost() > kMostCostShare * found.own.cost()) return;
    if (!is_confirmed(reading.descriptor)) return;
    found.better.push_back({reading.part, reading.said, reading.line, score.cost()});
  }

  // A reading may be the better by chance where a network hardly answers what it is told; then it is not so in other
  // trials.
  bool is_confirmed(const Descriptor& reading) {
    const std::vector<TrialTask> tasks = confirming_tasks(subject_.descriptor);
    if (own_confirming_.costs.empty())
      for (const TrialTask& task : tasks) add_trial(subject_.descriptor, task, own_confirming_);
    ReadingScore score;
    double gain = 0.0;
    for (std::size_t i = 0; i < tasks.size(); ++i) {
      add_trial(reading, tasks[i], score);
      gain += own_confirming_.costs[i] - score.costs[i];
      if (!score.trials[i].upright) return false;
    }
    return gain >= kLeastGain * static_cast<double>(tasks.size()) &&
           score.cost() <= kMostCostShare * own_confirming_.cost();
  }

  const AuditSubject& subject_;
  ReadingScore own_confirming_;
  TrialGround ground_;
  std::map<std::string, double> posture_;
  std::vector<std::size_t> order_;  // of the tasks
};

}  // namespace

ReadingSearch search_readings(const AuditSubject& subject, const std::string& engine) {
  return Search(subject, engine).run();
}

namespace {

constexpr double kMostAsymmetry = 2.0;    // published networks that are right: 0.3 to 1.8
constexpr double kMostFirstTarget = 1.0;  // [rad]
constexpr double kMostFollowing = 1.0;    // of a joint's own step
constexpr double kMostHeightLoss = 0.1;   // of the standing height, told to stand
constexpr double kLeastSpeedShare = 0.5;  // of the velocity that it is told
constexpr std::size_t kMostNamed = 3;     // readings that are as good as the best
constexpr double kAsGood = 0.03;          // of their cost

void add_level_1(const AuditSubject& subject, const ReadingSearch& search, ControllerAudit& audit) {
  const Descriptor& descriptor = subject.descriptor;
  const double image = search.own.asymmetry;
  audit.checks.push_back({1, "treats left and right alike",
                          fmt::format("{:.2f} of its movement is not a mirror image", image),
                          fmt::format("below {:g}", kMostAsymmetry), image < kMostAsymmetry});
  const JointFigure first = farthest_first_target(descriptor, *subject.robot, subject.make);
  audit.checks.push_back({1, "stands still",
                          fmt::format("first target {:.2f} rad from the default pose ({})", first.value, first.joint),
                          fmt::format("below {:g} rad", kMostFirstTarget), first.value < kMostFirstTarget});
  const JointFigure follows = strongest_following(descriptor, *subject.robot, subject.make);
  audit.checks.push_back({1, "joints answer a step",
                          fmt::format("{} follows its own step by {:.2f}", follows.joint, follows.value),
                          fmt::format("below {:g}", kMostFollowing), follows.value < kMostFollowing});
}

AuditCheck trial_check(const TrialPhysics& physics, const TrialTask& task, const TrialResult& result) {
  if (!result.upright)
    return {2, task.name, fmt::format("falls after {:.2f} s", result.lasted),
            fmt::format("upright for {:g} s", task.seconds), false};
  if (task.told.isZero()) {
    const double loss = 1.0 - result.height / physics.height;
    return {2, task.name, fmt::format("pelvis at {:.2f} m, drifts {:.2f} m", result.height, result.drift),
            fmt::format("{:.2f} m +- {:g} %, {}", physics.height, 100.0 * 2.0 * kMostHeightLoss, physics.height_from),
            std::abs(loss) < 2.0 * kMostHeightLoss};
  }
  Eigen::Index axis = 0;
  task.told.cwiseAbs().maxCoeff(&axis);
  const double share = result.went[axis] / task.told[axis];
  const char* unit = axis == 2 ? "rad/s" : "m/s";
  return {2, task.name, fmt::format("{:.2f} {}", result.went[axis], unit),
          fmt::format("{:.2f} {} +- {:g} %", task.told[axis], unit, 100.0 * kLeastSpeedShare),
          std::abs(share - 1.0) < kLeastSpeedShare};
}

std::string verdict_of(const ControllerAudit& audit, const ReadingSearch& search) {
  if (!audit.defects.empty())
    return "The contract is wrong: the descriptor does not say what the network was made for.";
  const bool falls = std::ranges::any_of(search.own.trials, [](const TrialResult& trial) { return !trial.upright; });
  if (falls)
    return fmt::format(
        "The policy or its body rather than the contract: it falls, and under none of {} other readings it does much "
        "better.",
        search.tried);
  return fmt::format("Nothing is named: under none of {} other readings it does much better.", search.tried);
}

}  // namespace

ControllerAudit audit_controller(const AuditSubject& subject, const std::string& engine) {
  const ReadingSearch search = search_readings(subject, engine);
  ControllerAudit audit;
  add_level_1(subject, search, audit);
  TrialPhysics physics = subject.physics;
  if (physics.height == 0.0) physics.height = subject.robot->standing_height;
  audit.checks.push_back({2, "physics",
                          fmt::format("{} at {:g} ms, {}; gains of its descriptor", engine,
                                      1e3 * (physics.dt > 0.0 ? physics.dt : Scene{}.dt), physics.dt_from),
                          ""});
  for (std::size_t i = 0; i < search.tasks.size(); ++i)
    audit.checks.push_back(trial_check(physics, search.tasks[i], search.own.trials[i]));
  for (const NamedDefect& defect : search.better)
    if (audit.defects.size() < kMostNamed && defect.cost < search.better[0].cost + kAsGood)
      audit.defects.push_back(defect);
  audit.readings = search.tried;
  audit.verdict = verdict_of(audit, search);
  return audit;
}

}  // namespace duet
