#include "duet/hardware/log/run_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "duet/core/require.h"
#include "duet/hardware/log/limiter_replay.h"
#include "duet/hardware/log/log_reader.h"

namespace duet {
namespace {

struct NamedAge {
  const char* name;
  double GuardHealth::*age;
};
constexpr NamedAge kAges[] = {
    {"state", &GuardHealth::state_age},       {"planner", &GuardHealth::planner_age},
    {"person", &GuardHealth::person_age},     {"odometry", &GuardHealth::odometry_age},
    {"remote", &GuardHealth::remote_age},     {"dead_man", &GuardHealth::dead_man_age},
    {"executor", &GuardHealth::executor_age},
};

struct NamedFault {
  const char* name;
  long GuardHealth::*count;
};
constexpr NamedFault kFaults[] = {
    {"checksum_faults", &GuardHealth::checksum_faults}, {"tick_faults", &GuardHealth::tick_faults},
    {"number_faults", &GuardHealth::number_faults},     {"old_messages", &GuardHealth::old_messages},
    {"bad_messages", &GuardHealth::bad_messages},
};

void note_most(double value, double at, RunReport::Peak& peak) {
  if (std::isfinite(value) && !(value <= peak.value)) peak = {value, at};
}

void note_least(double value, double at, RunReport::Peak& peak) {
  if (std::isfinite(value) && !(value >= peak.value)) peak = {value, at};
}

// Gathers a report message by message.
class ReportGatherer {
 public:
  explicit ReportGatherer(const std::string& path) : path_(path) {
    for (const NamedAge& age : kAges) report_.ages.push_back({age.name, {}});
  }

  LogParts parts() {
    LogParts parts;
    parts.setup = [this](const LimiterSetup& setup, const nlohmann::json& json) { take(setup, json); };
    parts.tick = [this](const TickRecord& tick) { take(tick); };
    parts.state = [this](const LowStateFrame& frame) { take(frame); };
    parts.command = [this](const LowCommandFrame& frame) { take(frame); };
    parts.event = [this](const LogEvent& event) { take(event); };
    parts.health = [this](const HealthMessage& message) { take(message.health); };
    return parts;
  }

  RunReport finish(bool whole) {
    if (report_.ticks == 0) throw InputError(fmt::format("{}: expected ticks of a guard, found none", path_));
    report_.whole = whole;
    report_.seconds = now_;
    end_span();
    for (RunReport::Joint& joint : report_.joints)
      joint.rms = report_.followed > 0 ? std::sqrt(joint.rms / static_cast<double>(report_.followed)) : kUnknown;
    if (report_.followed == 0)
      for (RunReport::Joint& joint : report_.joints) joint.largest = kUnknown;
    count_missed();
    return std::move(report_);
  }

 private:
  [[nodiscard]] bool runs() const { return state_ == "run"; }
  [[nodiscard]] bool moves() const { return state_ == "run" || state_ == "hold" || state_ == "stand"; }

  void take(const LimiterSetup& setup, const nlohmann::json& json) {
    limiter_.emplace(setup, path_);
    gap_.emplace(setup);
    const auto word = [&](const nlohmann::json& of, const char* name) {
      return of.is_object() && of.contains(name) && of[name].is_string() ? of[name].get<std::string>() : std::string();
    };
    report_.program = word(json, "duet");
    report_.odometry = word(json, "odometry");
    report_.executor = word(json.value("executor", nlohmann::json()), "executor");
    const nlohmann::json form = json.value("checklist", nlohmann::json());
    report_.checked_by = word(form, "who");
    report_.checked_when = word(form, "when");
    report_.checks.clear();
    if (form.is_object() && form.contains("items") && form["items"].is_array())
      for (const nlohmann::json& item : form["items"])
        report_.checks.push_back({word(item, "name"), word(item, "value"),
                                  item.is_object() && item.contains("done") && item["done"] == true});
    report_.joints.clear();
    for (const RobotJoint& joint : setup.robot->joints) report_.joints.push_back({joint.name, 0.0, 0.0, 0.0, {}});
  }

  void take(const TickRecord& tick) {
    if (report_.ticks++ == 0) begin_ = tick.now;
    const double before = now_;
    now_ = tick.now - begin_;
    tick_ = tick;
    (void)limiter_->agrees(tick);
    note_least(gap_->measure(tick), now_, report_.nearest);
    if (!runs()) return;
    report_.ran += now_ - before;
    report_.plans += (tick.flags & kTickReceived) != 0 ? 1 : 0;
    for (std::size_t k = 0; k < kClampReasons; ++k) report_.changed[k] += limiter_->clamps()[k];
    for (std::size_t j = 0; j < report_.joints.size(); ++j)
      for (std::size_t k = 0; k < kClampReasons; ++k)
        report_.joints[j].changed[k] += (limiter_->limiter().joint_clamps()[j] >> k) & 1U;
  }

  void take(const LowStateFrame& frame) {
    ++report_.states;
    if (checksum_of(frame) != frame.crc) return;
    if (last_tick_ && frame.tick > *last_tick_) ++steps_[frame.tick - *last_tick_];
    last_tick_ = frame.tick;
    for (int j = 0; j < kG1Motors; ++j) {
      const double casing = frame.motor[j].temperature[0], winding = frame.motor[j].temperature[1];
      note_most(casing, now_, report_.casing);
      note_most(winding, now_, report_.winding);
      report_.joints[j].hottest = std::max({report_.joints[j].hottest, casing, winding});
    }
  }

  void take(const LowCommandFrame& frame) {
    ++report_.commands;
    if (sent_at_ && now_ - *sent_at_ < kPause) report_.commanded += now_ - *sent_at_;
    sent_at_ = now_;
    if (!runs()) return;
    ++report_.followed;
    for (int j = 0; j < kG1Motors; ++j) {
      const double apart = std::abs(static_cast<double>(frame.motor[j].q) - tick_.q[j]);
      report_.joints[j].rms += apart * apart;
      report_.joints[j].largest = std::max(report_.joints[j].largest, apart);
    }
  }

  void take(const LogEvent& event) {
    const double at = std::max(event.time - begin_, 0.0);
    report_.dropped += event.dropped;
    if (event.dropped > 0) add_fault("dropped", at, event.dropped);
    if (event.restarts > 0) add_fault("restarts", at, event.restarts);
    if (event.refused > 0) add_fault("estimates refused: " + event.why, at, event.refused);
    if (event.kept_out > 0) add_fault("from the network, refused: " + event.why, at, event.kept_out);
    if (event.dropped > 0 || event.restarts > 0 || event.refused > 0 || event.kept_out > 0 || event.state == state_)
      return;
    end_span();
    state_ = event.state;
    report_.spans.push_back({at, 0.0, event.state, event.cause});
  }

  void take(const GuardHealth& health) {
    report_.has_health = true;
    for (const NamedFault& fault : kFaults)
      if (const long more = health.*fault.count - health_.*fault.count; more > 0) add_fault(fault.name, now_, more);
    health_ = health;
    note_most(health.tilt, now_, report_.tilt);
    note_most(health.late, now_, report_.late);
    if (std::isfinite(health.charge)) {
      if (!std::isfinite(report_.charge_first)) report_.charge_first = health.charge;
      report_.charge_last = health.charge;
    }
    for (std::size_t k = 0; k < std::size(kAges) && moves(); ++k)
      note_most(health.*kAges[k].age, now_, report_.ages[k].oldest);
  }

  void end_span() {
    if (!report_.spans.empty()) report_.spans.back().seconds = now_ - report_.spans.back().begin;
  }

  void add_fault(const std::string& name, double at, long count) {
    auto fault = std::ranges::find(report_.faults, name, &RunReport::Fault::name);
    if (fault == report_.faults.end()) fault = report_.faults.insert(fault, {name, at, at, 0});
    fault->last = at;
    fault->count += count;
  }

  // The robot counts its states by a step of its own: the most frequent one between two that were read.
  void count_missed() {
    const auto usual = std::ranges::max_element(steps_, {}, [](const auto& step) { return step.second; });
    if (usual == steps_.end()) return;
    for (const auto& [step, count] : steps_)
      report_.missed += count * std::max(0L, static_cast<long>(step / usual->first) - 1);
  }

  static constexpr double kPause = 0.1;  // between two commands: they ended, and began anew [s]

  const std::string& path_;
  RunReport report_;
  std::optional<LimiterReplay> limiter_;
  std::optional<PersonGap> gap_;
  double begin_ = 0.0, now_ = 0.0;  // of the log; since then
  std::string state_ = "offline";
  TickRecord tick_{};
  GuardHealth health_;
  std::optional<std::uint32_t> last_tick_;
  std::map<std::uint32_t, long> steps_;
  std::optional<double> sent_at_;
};

}  // namespace

RunReport report_of_log(const std::string& path) {
  ReportGatherer gatherer(path);
  return gatherer.finish(read_run_log(path, gatherer.parts()));
}

}  // namespace duet
