#include "duet/execution/blame.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "duet/core/names.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/report/tables/text_table.h"
#include "duet/rollout/act_episode.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/rows/json_fields.h"
#include "duet/statistics/statistics.h"

namespace duet {
namespace {

// The engines that an episode is restarted in, its own first.
std::vector<std::string> engines_of(const EpisodeSpec& spec, const BlameOptions& options) {
  std::vector<std::string> found = {spec.engine};
  std::vector<std::string> present;
  for (const EngineInfo& engine : engines())
    if (engine.available) present.push_back(engine.name);
  for (const std::string& name : options.engines.empty() ? present : options.engines) {
    if (std::ranges::find(present, name) == present.end())
      throw MissingError(unknown_name_message("engine", name, present));
    if (std::ranges::find(found, name) == found.end()) found.push_back(name);
  }
  require(found.size() > 1, "blame: expected an engine beside the episode's own, found {} alone", spec.engine);
  return found;
}

RobotState jittered(RobotState state, Random& random) {
  for (int axis = 0; axis < 3; ++axis) {
    state.v_WB[axis] += RestartJitter::kSpeed * random.normal();
    state.w_WB_B[axis] += RestartJitter::kTurn * random.normal();
  }
  for (double& v : state.v) v += RestartJitter::kJoint * random.normal();
  return state;
}

// Runs of one episode in any engine, from its start or from a state that it had.
class EpisodeRuns {
 public:
  EpisodeRuns(const Experiment& experiment, const EpisodeSpec& spec, const BlameOptions& options)
      : experiment_(experiment), spec_(spec), options_(options), engines_(engines_of(spec, options)) {
    for (const std::string& engine : engines_) settings_[engine] = experiment.suite().profile.settings(engine);
  }

  [[nodiscard]] const std::vector<std::string>& engines() const { return engines_; }

  struct Run {
    EpisodeRow row;
    Recording recording;
  };

  [[nodiscard]] Run run(const std::string& engine, const EpisodeRestart* restart) const {
    EpisodeSpec spec = spec_;
    spec.engine = engine;
    spec.settings = &settings_.at(engine);
    Run run;
    const auto world = [&](const RolloutSetup& setup, Policy& policy) {
      RolloutSetup own = setup;
      own.restart = restart;
      const std::unique_ptr<Backend> backend = options_.make_engine(engine, experiment_.scene(spec));
      Rollout rollout = roll_out(own, *backend, *Experiment::controller(spec), policy);
      run.recording = rollout.recording;
      return rollout;
    };
    run.row = experiment_.run(spec, {.policy = options_.policy, .engine = engine, .world = world});
    return run;
  }

 private:
  const Experiment& experiment_;
  const EpisodeSpec& spec_;
  const BlameOptions& options_;
  std::vector<std::string> engines_;
  std::map<std::string, EngineSettings> settings_;
};

// The tick at which the episode has failed.
int failure_tick(const EpisodeRuns::Run& run) {
  const int last = run.recording.frames() - 1;
  return run.row.outcome != Outcome::kOk ? last : std::clamp(run.recording.phases.act_end, 0, last);
}

std::vector<int> restart_ticks(int failure, const std::vector<double>& before) {
  std::set<int> ticks = {0};
  for (const double seconds : before)
    if (const int tick = failure - ticks_of(seconds); tick > 0) ticks.insert(tick);
  return {ticks.begin(), ticks.end()};
}

std::vector<RestartInstant> restarts_of(const EpisodeRuns& runs, const Recording& recorded,
                                        const std::vector<int>& ticks, const BlameOptions& options,
                                        Progress& progress) {
  const int engines = static_cast<int>(runs.engines().size());
  const int per_instant = engines * options.jitters, count = static_cast<int>(ticks.size()) * per_instant;
  std::vector<EpisodeRow> rows(static_cast<std::size_t>(count));
  progress.start("restarting", count, "episodes");
  parallel_for_each(count, options.threads, [&](int i) {
    const int tick = ticks[static_cast<std::size_t>(i / per_instant)], jitter = i % options.jitters;
    // The same jitters in every engine.
    Random random(options.seed, stream_key({"blame", std::to_string(tick), std::to_string(jitter)}));
    const EpisodeRestart restart{recorded.robot, tick,
                                 jittered(recorded.robot[static_cast<std::size_t>(tick)], random)};
    const auto engine = static_cast<std::size_t>(i % per_instant / options.jitters);
    rows[static_cast<std::size_t>(i)] = runs.run(runs.engines()[engine], &restart).row;
    progress.advance();
  });
  progress.finish();
  std::vector<RestartInstant> instants(ticks.size());
  for (int i = 0; i < count; ++i) {
    RestartInstant& instant = instants[static_cast<std::size_t>(i / per_instant)];
    instant.tick = ticks[static_cast<std::size_t>(i / per_instant)];
    Restarts& of = instant.engines[runs.engines()[static_cast<std::size_t>(i % per_instant / options.jitters)]];
    const EpisodeRow& row = rows[static_cast<std::size_t>(i)];
    if (row.outcome == Outcome::kError || row.outcome == Outcome::kUnsupported) {
      of.refusal = row.message;
      continue;
    }
    ++of.ran;
    of.failed += headline_success(row) ? 0 : 1;
  }
  return instants;
}

void add(Restarts& sum, const Restarts& more) {
  sum.failed += more.failed;
  sum.ran += more.ran;
}

Restarts of_own(const RestartInstant& instant, const std::string& own) {
  const auto found = instant.engines.find(own);
  return found == instant.engines.end() ? Restarts{} : found->second;
}

// Over all restarts in engines but `own`.
Restarts of_others(const RestartInstant& instant, const std::string& own) {
  Restarts others;
  for (const auto& [engine, of] : instant.engines)
    if (engine != own) add(others, of);
  return others;
}

double own_share(const RestartInstant& instant, const std::string& own) { return of_own(instant, own).share(); }
double share_of_others(const RestartInstant& instant, const std::string& own) {
  return of_others(instant, own).share();
}

// The p-value that restarts fail in `own` no more often than in the others, over all states from which the others can
// still succeed.
double own_engine_p(const std::vector<RestartInstant>& instants, const std::string& own) {
  Restarts mine, others;
  for (const RestartInstant& instant : instants) {
    const Restarts theirs = of_others(instant, own);
    if (!(theirs.share() < kMostly)) continue;
    add(mine, of_own(instant, own));
    add(others, theirs);
  }
  return fisher_exact_greater(mine.failed, mine.ran, others.failed, others.ran);
}

bool all_fail(const RestartInstant& instant) {
  return std::ranges::all_of(instant.engines, [](const auto& of) { return of.second.share() >= kMostly; });
}

double all_fail_from(const std::vector<RestartInstant>& instants) {
  double from = std::numeric_limits<double>::quiet_NaN();
  for (auto instant = instants.rbegin(); instant != instants.rend() && all_fail(*instant); ++instant)
    from = instant->seconds();
  return from;
}

// The state from which the first divergence is looked for: the last one from which the others do not fail, else the
// start.
int parting_tick(const std::vector<RestartInstant>& instants, const std::string& own) {
  int tick = 0;
  for (const RestartInstant& instant : instants)
    if (own_share(instant, own) >= kMostly && share_of_others(instant, own) <= kRarely) tick = instant.tick;
  return tick;
}

}  // namespace

std::string_view to_string(Culprit culprit) {
  switch (culprit) {
    case Culprit::kNobody:
      return "nobody";
    case Culprit::kSolver:
      return "solver";
    case Culprit::kPolicy:
      return "policy";
    case Culprit::kUnclear:
      return "unclear";
  }
  return "?";
}

Culprit culprit_of(const std::vector<RestartInstant>& instants, const std::string& own) {
  if (!instants.empty() && share_of_others(instants.front(), own) >= kMostly) return Culprit::kPolicy;
  for (const RestartInstant& instant : instants) {
    if (!(own_share(instant, own) >= kMostly)) continue;
    if (share_of_others(instant, own) <= kRarely) return Culprit::kSolver;
    break;
  }
  return own_engine_p(instants, own) < kChance ? Culprit::kSolver : Culprit::kUnclear;
}

Blame blame_episode(const Experiment& experiment, const EpisodeSpec& spec, const BlameOptions& options,
                    Progress& progress) {
  require(spec.engine != kPlaybackEngine, "blame: expected an episode in an engine, found one of playback");
  require(spec.reference == nullptr, "blame: expected an episode of a clip, found one of a walking command");
  require(experiment.suite().partner != SuitePartner::kYielding,
          "blame: expected a partner who is a ghost or solid, found one who yields: a restart does not say how they "
          "moved");
  const EpisodeRuns runs(experiment, spec, options);
  const EpisodeRuns::Run run = runs.run(spec.engine, nullptr);
  Blame blame;
  blame.row = run.row;
  if (headline_success(run.row)) return blame;
  if (run.recording.frames() == 0)
    throw InputError(fmt::format("blame: the episode has no motion to restart from: {}", run.row.message));
  const int failure = failure_tick(run);
  blame.failure = failure / kTickRate;
  blame.instants = restarts_of(runs, run.recording, restart_ticks(failure, options.before), options, progress);
  blame.culprit = culprit_of(blame.instants, spec.engine);
  blame.all_fail_from = all_fail_from(blame.instants);
  const int tick = parting_tick(blame.instants, spec.engine);
  const EpisodeRestart restart{run.recording.robot, tick, run.recording.robot[static_cast<std::size_t>(tick)]};
  std::vector<Recording> others;
  for (const std::string& engine : runs.engines())
    if (engine != spec.engine)
      if (Recording other = runs.run(engine, &restart).recording; other.frames() > tick)
        others.push_back(std::move(other));
  if (!others.empty()) blame.divergence = first_divergence(run.recording, others, *spec.body->robot, tick);
  return blame;
}

namespace {

// A quantity of a recording at a tick, and the difference from which it counts as another.
struct Quantity {
  std::string name, unit;
  double threshold;
  std::function<double(const Recording& of, int tick)> value;
};

// Ticks over which contact forces are averaged: engines share them out among steps otherwise.
constexpr int kForceTicks = 10;

double mean_ground_force(const Recording& of, int tick) {
  double sum = 0.0;
  const int first = std::max(0, tick - kForceTicks + 1);
  for (const RecordedContact& contact : of.contacts)
    if (contact.frame >= first && contact.frame <= tick && contact.contact.side == ContactSide::kGround)
      sum += contact.contact.f_W.z();
  return sum / (tick - first + 1);
}

double tilt_of(const Recording& of, int tick) {
  const Eigen::Vector3d up = of.robot[static_cast<std::size_t>(tick)].X_WB.R * Eigen::Vector3d::UnitZ();
  return std::acos(std::clamp(up.z(), -1.0, 1.0));
}

std::vector<Quantity> quantities_of(const RobotModel& robot) {
  constexpr double kHeight = 0.02, kTilt = 0.1, kPlace = 0.05, kAngle = 0.15;  // [m], [rad], [m], [rad]
  constexpr double kWeightShare = 0.35;
  const auto at = [](int tick) { return static_cast<std::size_t>(tick); };
  std::vector<Quantity> list = {
      {"root height", "m", kHeight, [at](const Recording& of, int t) { return of.robot[at(t)].X_WB.p.z(); }},
      {"root tilt", "rad", kTilt, tilt_of},
      {"root place along x", "m", kPlace, [at](const Recording& of, int t) { return of.robot[at(t)].X_WB.p.x(); }},
      {"root place along y", "m", kPlace, [at](const Recording& of, int t) { return of.robot[at(t)].X_WB.p.y(); }},
      {"contact force", "N", kWeightShare * robot.total_mass() * kGravity, mean_ground_force}};
  const std::vector<std::string> joints = robot.joint_names();
  for (int j = 0; j < static_cast<int>(joints.size()); ++j) {
    list.push_back(
        {joints[at(j)], "rad", kAngle, [at, j](const Recording& of, int t) { return of.robot[at(t)].q[j]; }});
    list.push_back({"plan of " + joints[at(j)], "rad", kAngle,
                    [at, j](const Recording& of, int t) { return of.reference[at(t)].q[j]; }});
  }
  return list;
}

}  // namespace

FirstDivergence first_divergence(const Recording& own, const std::vector<Recording>& others, const RobotModel& robot,
                                 int tick) {
  require(!others.empty(), "blame: expected another engine's recording, found none");
  const std::vector<Quantity> quantities = quantities_of(robot);
  int end = own.frames();
  for (const Recording& other : others) end = std::min(end, other.frames());
  for (int t = tick; t < end; ++t) {
    FirstDivergence first;
    double most = 1.0;  // of thresholds
    for (const Quantity& quantity : quantities) {
      // Contacts of the recorded part are not kept in a restart.
      if (quantity.unit == "N" && t < tick + kForceTicks) continue;
      const double value = quantity.value(own, t);
      double nearest = std::numeric_limits<double>::infinity();
      for (const Recording& other : others)
        if (const double theirs = quantity.value(other, t); std::abs(theirs - value) < std::abs(nearest - value))
          nearest = theirs;
      const double ratio = std::abs(value - nearest) / quantity.threshold;
      if (ratio <= most) continue;
      most = ratio;
      first = {quantity.name, t / kTickRate, value, nearest, quantity.unit};
    }
    if (!first.quantity.empty()) return first;
  }
  return {};
}

namespace {

std::string verdict_text(const Blame& blame) {
  const std::string& own = blame.row.engine;
  switch (blame.culprit) {
    case Culprit::kNobody:
      return "The episode succeeds: there is nothing to blame.";
    case Culprit::kSolver:
      return fmt::format(
          "The solver's: from the same states, under the same policy, it fails in {} and not, or far less, in the "
          "others.",
          own);
    case Culprit::kPolicy:
      return "The policy's or the controller's: from the start of the episode it fails in the other engines, too.";
    case Culprit::kUnclear:
      break;
  }
  if (!std::isnan(blame.all_fail_from) && blame.all_fail_from > 0.0)
    return fmt::format(
        "Unclear: from the start it does not always come back; from {:.2f} s on it does, in every engine, from where "
        "{} "
        "had brought the robot.",
        blame.all_fail_from, own);
  return fmt::format("Unclear: from jittered states it does not come back in {}, or it does in some of the others.",
                     own);
}

std::string divergence_text(const FirstDivergence& divergence) {
  if (divergence.quantity.empty()) return "No quantity leaves what the other engines do before the failure.";
  return fmt::format("First apart: {} at {:.2f} s, {} {} here and {} in the nearest other engine.", divergence.quantity,
                     divergence.seconds, decimals(divergence.own, 3), divergence.unit, decimals(divergence.nearest, 3));
}

}  // namespace

std::string blame_text(const Blame& blame) {
  const EpisodeRow& row = blame.row;
  std::string text = fmt::format("{}/{}/{} in {} under {}, {}: {}\n", row.task, row.clip, row.episode, row.engine,
                                 row.controller, row.policy, row.message.empty() ? "no success" : row.message);
  text += verdict_text(blame) + "\n";
  if (blame.culprit == Culprit::kNobody) return text;
  text += std::isnan(blame.all_fail_from)
              ? "At no time do all engines fail.\n"
              : fmt::format("From {:.2f} s on it fails in every engine; it failed at {:.2f} s.\n", blame.all_fail_from,
                            blame.failure);
  text += divergence_text(blame.divergence) + "\n\n";
  TextTable table{.header = {"Restarted at [s]"}, .rows = {}, .label_columns = 1};
  for (const auto& [engine, of] : blame.instants.front().engines) table.header.push_back(engine);
  for (const RestartInstant& instant : blame.instants) {
    std::vector<std::string>& cells = table.rows.emplace_back(1, decimals(instant.seconds(), 2));
    for (const auto& [engine, of] : instant.engines)
      cells.push_back(of.ran == 0 ? "refused" : fmt::format("{} of {} fail", of.failed, of.ran));
  }
  return text + markdown_table(table);
}

nlohmann::json blame_json(const Blame& blame) {
  nlohmann::json instants = nlohmann::json::array();
  for (const RestartInstant& instant : blame.instants) {
    nlohmann::json engines = nlohmann::json::object();
    for (const auto& [engine, of] : instant.engines) {
      engines[engine] = {{"failed", of.failed}, {"ran", of.ran}};
      if (!of.refusal.empty()) engines[engine]["refusal"] = of.refusal;
    }
    instants.push_back({{"seconds", instant.seconds()}, {"engines", std::move(engines)}});
  }
  const FirstDivergence& first = blame.divergence;
  nlohmann::json divergence = nullptr;
  if (!first.quantity.empty())
    divergence = {{"quantity", first.quantity},
                  {"seconds", first.seconds},
                  {"own", first.own},
                  {"nearest", first.nearest},
                  {"unit", first.unit}};
  return {{"key", blame.row.key},
          {"engine", blame.row.engine},
          {"culprit", to_string(blame.culprit)},
          {"failure_s", blame.failure},
          {"all_fail_from_s", number_or_null(blame.all_fail_from)},
          {"restarts", std::move(instants)},
          {"first_divergence", std::move(divergence)}};
}

}  // namespace duet
