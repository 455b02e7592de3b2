// duet hw report: what a debriefing asks of a run's log. duet hw status: how a guard that runs is now. duet replay-log.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/file_batch.h"
#include "duet/core/machine.h"
#include "duet/core/named_table.h"
#include "duet/core/require.h"
#include "duet/hardware/guard/guard_message.h"
#include "duet/hardware/log/limiter_replay.h"
#include "duet/hardware/log/run_report.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "duet/parts/robot/hw.h"
#include "duet/parts/robot/part.h"
#include "duet/report/tables/analysis.h"

namespace duet::cli {
namespace {

constexpr int kStatusEvery = 5;          // messages of health: 10 times a second
constexpr double kStatusPatience = 2.0;  // [s]
constexpr std::size_t kStatusBytes = 8192;
constexpr std::size_t kWorstJoints = 5;  // that the terminal has

std::string seconds_cell(double seconds) { return decimals(seconds, 2); }

std::string peak_text(const RunReport::Peak& peak, const char* unit, int digits) {
  if (!std::isfinite(peak.value)) return "not known";
  return fmt::format("{:.{}f} {} at {:.2f} s", peak.value, digits, unit, peak.at);
}

// "left_elbow_joint 120, left_wrist_roll_joint 3": ticks in which the reason changed the joint, the most first.
std::string joints_text(const RunReport& report, std::size_t reason) {
  std::vector<std::pair<long, std::string>> joints;
  for (const RunReport::Joint& joint : report.joints)
    if (joint.changed[reason] > 0) joints.emplace_back(joint.changed[reason], joint.name);
  std::ranges::stable_sort(joints, std::greater<>(), &std::pair<long, std::string>::first);
  std::string text;
  for (const auto& [ticks, name] : joints) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", name, ticks);
  return text.empty() ? "-" : text;
}

// Tables and their figures side by side.
class LogAnalysis {
 public:
  LogAnalysis(const RunReport& report, const std::string& path) : report_(report) {
    analysis_.name = "log";
    analysis_.title = fmt::format("Log '{}'", path);
  }
  Analysis make() {
    add_notes();
    add_checks();
    add_states();
    add_faults();
    add_changes();
    add_joints();
    if (report_.has_health) add_ages();
    add_rates();
    add_peaks();
    return std::move(analysis_);
  }

 private:
  void add_notes() {
    std::vector<std::string>& notes = analysis_.notes;
    notes.push_back(
        fmt::format("{:.2f} s, {:.2f} s of them in the state run; executor '{}', odometry '{}', duet {}; {}.",
                    report_.seconds, report_.ran, report_.executor, report_.odometry, report_.program,
                    report_.whole ? "the log is whole" : "the log has no end: its writer was stopped"));
    if (report_.dropped > 0)
      notes.push_back(fmt::format("{} ticks are not in the log, which had no room for them.", report_.dropped));
    notes.push_back(std::isfinite(report_.nearest.value)
                        ? fmt::format("Nearest part of the person: {}.", peak_text(report_.nearest, "m away", 3))
                        : "No place of a person was known.");
    notes.push_back(fmt::format("Hottest casing {}, winding {}.", peak_text(report_.casing, "degrees C", 0),
                                peak_text(report_.winding, "degrees C", 0)));
    if (report_.has_health)
      notes.push_back(fmt::format("Charge {}; largest tilt {}; latest tick {}.", charge_text(),
                                  peak_text(report_.tilt, "rad", 3), peak_text(late_ms(), "ms late", 1)));
    else
      notes.emplace_back("The log has an older form: ages, charge, tilt and faults of messages are not in it.");
  }
  [[nodiscard]] std::string charge_text() const {
    if (!std::isfinite(report_.charge_first)) return "not known";
    return fmt::format("{:.0f} % at the begin, {:.0f} % at the end", report_.charge_first, report_.charge_last);
  }
  [[nodiscard]] RunReport::Peak late_ms() const { return {1e3 * report_.late.value, report_.late.at}; }

  [[nodiscard]] EstimatesOf of(const std::string& what) { return {{.of = what}, analysis_.estimates}; }

  TextTable& add_table(const char* title, std::vector<std::string> header, std::size_t labels,
                       const char* nothing = "") {
    analysis_.tables.push_back({.title = title, .table = {.header = std::move(header), .label_columns = labels}});
    nothing_ = nothing;
    return analysis_.tables.back().table;
  }
  void end_table() {
    TitledTable& titled = analysis_.tables.back();
    if (titled.table.rows.empty()) titled.notes.emplace_back(nothing_);
  }

  void add_checks() {
    if (report_.checks.empty()) return;
    TextTable& table = add_table("Checklist", {"Item", "Done", "Value"}, 3);
    for (const RunReport::Check& check : report_.checks) {
      table.rows.push_back({check.name, check.done ? "yes" : "no", check.value.empty() ? "-" : check.value});
      of(check.name).word("checked", check.done ? "yes" : "no");
      if (!check.value.empty()) of(check.name).word("check_value", check.value);
    }
    analysis_.tables.back().notes.push_back(
        fmt::format("Filled in by {} at {}.", report_.checked_by, report_.checked_when));
  }

  void add_states() {
    TextTable& table = add_table("States", {"State", "Why", "From [s]", "For [s]"}, 2, "The state never changed.");
    for (std::size_t k = 0; k < report_.spans.size(); ++k) {
      const RunReport::Span& span = report_.spans[k];
      table.rows.push_back({span.state, span.cause, seconds_cell(span.begin), seconds_cell(span.seconds)});
      const EstimatesOf estimates = of(fmt::format("{}", k + 1));
      estimates.word("state", span.state);
      estimates.word("cause", span.cause);
      estimates.add("begin", {}, span.begin, kNoInterval, "s");
      estimates.add("lasted", {}, span.seconds, kNoInterval, "s");
    }
    end_table();
  }

  void add_faults() {
    TextTable& table = add_table("Faults", {"What", "Times", "First [s]", "Last [s]"}, 1, "There was none.");
    for (const RunReport::Fault& fault : report_.faults) {
      table.rows.push_back({fault.name, count_cell(fault.count), seconds_cell(fault.first), seconds_cell(fault.last)});
      of(fault.name).count("faults", {}, fault.count);
      of(fault.name).add("first_fault", {}, fault.first, kNoInterval, "s");
      of(fault.name).add("last_fault", {}, fault.last, kNoInterval, "s");
    }
    end_table();
  }

  void add_changes() {
    TextTable& table = add_table("What the limiter changed while it ran", {"Reason", "Times", "Joints, with ticks"}, 1,
                                 "It changed nothing.");
    for (std::size_t k = 0; k < kClampReasons; ++k) {
      if (report_.changed[k] == 0) continue;
      const std::string reason(kClampNames[k]);
      table.rows.push_back({reason, count_cell(report_.changed[k]), joints_text(report_, k)});
      of(reason).count("changes", {}, report_.changed[k]);
    }
    end_table();
  }

  void add_joints() {
    const auto begin_table = [&](const char* title) -> TextTable& {
      return add_table(
          title, {"Joint", "Off its target, RMS [rad]", "At most [rad]", "Hottest [degrees C]", "Changed, ticks"}, 1);
    };
    std::vector<const RunReport::Joint*> joints;
    for (const RunReport::Joint& joint : report_.joints) joints.push_back(&joint);
    TextTable& all = begin_table("Joints");
    for (const RunReport::Joint* joint : joints) all.rows.push_back(joint_row(*joint));
    analysis_.tables.back().too_long_for_terminal = true;
    std::ranges::stable_sort(joints, std::greater<>(), &RunReport::Joint::largest);
    TextTable& worst = begin_table("Joints furthest from their targets while it ran");
    for (std::size_t k = 0; k < std::min(kWorstJoints, joints.size()) && report_.followed > 0; ++k)
      worst.rows.push_back(joint_row(*joints[k]));
    nothing_ = "It never ran: no joint followed a planner.";
    end_table();
    for (const RunReport::Joint& joint : report_.joints) add_figures(joint);
  }

  static std::vector<std::string> joint_row(const RunReport::Joint& joint) {
    long changed = 0;
    for (const long ticks : joint.changed) changed += ticks;
    return {joint.name, decimals(joint.rms, 4), decimals(joint.largest, 4), decimals(joint.hottest, 0),
            count_cell(changed)};
  }

  void add_figures(const RunReport::Joint& joint) {
    for (std::size_t k = 0; k < kClampReasons; ++k)
      if (joint.changed[k] > 0)
        of(fmt::format("{}/{}", joint.name, kClampNames[k])).count("changed_ticks", {}, joint.changed[k]);
    of(joint.name).add("tracking_rms", report_.followed, joint.rms, kNoInterval, "rad");
    of(joint.name).add("tracking_most", report_.followed, joint.largest, kNoInterval, "rad");
    of(joint.name).add("hottest", {}, joint.hottest, kNoInterval, "degC");
  }

  void add_ages() {
    TextTable& table = add_table("Oldest while it stood, ran or held", {"Of", "Age [ms]", "At [s]"}, 1);
    for (const RunReport::Age& age : report_.ages) {
      table.rows.push_back({age.name, decimals(1e3 * age.oldest.value, 1), decimals(age.oldest.at, 2)});
      of(age.name).add("oldest", {}, age.oldest.value, kNoInterval, "s");
    }
  }

  void add_rates() {
    TextTable& table = add_table("Rates", {"Of", "Number", "Over [s]", "A second"}, 1);
    const auto add = [&](const char* name, long number, double seconds) {
      const double rate = seconds > 0.0 ? static_cast<double>(number) / seconds : kUnknown;
      table.rows.push_back({name, count_cell(number), seconds_cell(seconds), decimals(rate, 1)});
      of(name).count("number", {}, number);
      of(name).add("rate", {}, rate, kNoInterval, "Hz");
    };
    add("ticks", report_.ticks, report_.seconds);
    add("states read", report_.states, report_.seconds);
    add("states missed", report_.missed, report_.seconds);
    add("commands sent", report_.commands, report_.commanded);
    add("plans while it ran", report_.plans, report_.ran);
  }

  void add_peaks() {
    const EstimatesOf all = of("");
    all.add("seconds", report_.ticks, report_.seconds, kNoInterval, "s");
    all.add("ran", {}, report_.ran, kNoInterval, "s");
    all.add("nearest_person", {}, report_.nearest.value, kNoInterval, "m");
    all.add("casing", {}, report_.casing.value, kNoInterval, "degC");
    all.add("winding", {}, report_.winding.value, kNoInterval, "degC");
    all.add("charge_first", {}, report_.charge_first, kNoInterval, "%");
    all.add("charge_last", {}, report_.charge_last, kNoInterval, "%");
    all.add("tilt", {}, report_.tilt.value, kNoInterval, "rad");
    all.add("late", {}, report_.late.value, kNoInterval, "s");
    all.count("ticks_left_out", {}, report_.dropped);
    all.word("log", report_.whole ? "whole" : "cut off");
  }

  const RunReport& report_;
  Analysis analysis_;
  const char* nothing_ = "";
};

struct ReportArguments {
  std::string log, output;
  std::vector<std::string> formats = {"md", "json"};
};

void run_log_report(Session& session, const ReportArguments& arguments) {
  static const std::vector<std::string> known = {"md", "csv", "json", "tex"};
  for (const std::string& format : arguments.formats) require_known("format", format, known);
  const Analysis analysis = LogAnalysis(report_of_log(arguments.log), arguments.log).make();
  if (!arguments.output.empty()) {
    FileBatch batch;
    for (const std::string& format : arguments.formats)
      for (const auto& [name, text] : analysis_files({analysis}, format)) {
        batch.write(join_without_links(arguments.output, name), text);
        note(session, fmt::format("wrote {}/{}", arguments.output, name));
      }
    batch.put_in_place();
  }
  print(session, terminal_text(analysis), analysis_json(analysis));
}

void run_status(Session& session, const std::string& socket, double seconds) {
  const std::string path = status_path(socket);
  DatagramSocket from = DatagramSocket::at_path(path);
  std::vector<std::byte> buffer(kStatusBytes);
  const double begin = monotonic_seconds();
  for (bool first = true; first || monotonic_seconds() - begin < seconds; first = false) {
    std::size_t size = 0;
    if (from.wait(kStatusPatience))
      for (std::size_t more = from.receive(buffer); more > 0; more = from.receive(buffer)) size = more;
    if (size == 0)
      throw MissingError(
          fmt::format("no guard tells its status at '{}': 'duet hw arm' does, and 'duet hw dry-run' with --log", path));
    const std::string text(reinterpret_cast<const char*>(buffer.data()), size);
    const HealthMessage message = parse_health(text, path);
    print(session, health_text(message), health_json(message));
  }
}

void run_replay(Session& session, const std::string& path) {
  const LogReplay replay = replay_log(path);
  print(session,
        fmt::format("{}: {} ticks, {} with another output{}; the log {}", path, replay.ticks, replay.different,
                    replay.dropped == 0 ? "" : fmt::format(" ({} ticks are not in it)", replay.dropped),
                    replay.whole ? "is whole" : "was cut off"),
        {{"ticks", replay.ticks},
         {"different", replay.different},
         {"dropped", replay.dropped},
         {"whole", replay.whole},
         {"events", replay.events}});
  if (replay.different > 0) session.exit_code = kExitDeterminism;
}

}  // namespace

RunLog::Watch status_sender(const std::string& socket) {
  struct Sender {
    std::string path;
    std::unique_ptr<DatagramSocket> to;
    int messages = 0;
  };
  const auto sender = std::make_shared<Sender>(Sender{status_path(socket), nullptr, 0});  // std::function copies
  return [sender](const std::string& text) {
    if (sender->messages++ % kStatusEvery != 0) return;
    std::error_code error;
    if (!sender->to && !std::filesystem::exists(sender->path, error)) return;
    try {
      if (!sender->to) sender->to = std::make_unique<DatagramSocket>(DatagramSocket::to_path(sender->path));
      if (!sender->to->send(std::as_bytes(std::span(text)))) sender->to.reset();
    } catch (const std::runtime_error&) {  // nobody listens there
      sender->to.reset();
    }
  };
}

void add_log_commands(CLI::App& hardware, Session& session) {
  const auto arguments = std::make_shared<ReportArguments>();
  CLI::App* report = add_command(hardware, session, "report", "what a debriefing asks of a run's log",
                                 "duet hw report run.mcap --format md,json --output debriefing");
  report->add_option("log", arguments->log, "log of `duet hw arm` or `dry-run` (MCAP)")->required();
  report->add_option("-f,--format", arguments->formats, "of the files: md, csv, json, tex (default: md,json)")
      ->delimiter(',');
  report->add_option("-o,--output", arguments->output, "folder for the files; without: none");
  report->callback([&session, arguments] { run_log_report(session, *arguments); });
  struct StatusArguments {
    std::string socket = "duet-guard.socket";
    double seconds = 0.0;
  };
  const auto asked = std::make_shared<StatusArguments>();
  CLI::App* status = add_command(hardware, session, "status", "how a guard that runs is now, and the next key",
                                 "duet hw status --seconds 60");
  status->add_option("--socket", asked->socket, "local socket of the guard")->capture_default_str();
  status->add_option("--seconds", asked->seconds, "how long to go on; 0: one status")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 86400.0));
  status->callback([&session, asked] { run_status(session, asked->socket, asked->seconds); });
}

void add_replay_log(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "replay-log",
                                  "pass a run's log through the limiter again: the same bits, or exit code 5",
                                  "duet replay-log run.mcap");
  const auto path = std::make_shared<std::string>();
  command->add_option("log", *path, "log of `duet hw arm` or `dry-run` (MCAP)")->required();
  command->callback([&session, path] { run_replay(session, *path); });
}

}  // namespace duet::cli
