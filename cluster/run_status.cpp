#include "duet/cluster/run_status.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>

#include "duet/cluster/attempt.h"
#include "duet/cluster/work_shard.h"
#include "duet/experiment/work/run_work.h"
#include "duet/rows/merge/merge_files.h"
#include "duet/rows/row_file.h"

namespace duet {
namespace {

constexpr std::array kStates = {ShardState::kDone, ShardState::kRunning, ShardState::kFailed, ShardState::kStopped,
                                ShardState::kWaiting};
constexpr std::size_t kMostShardLines = 20;

using Tally = std::map<std::string, Outcome>;  // by key: of the row that stands

// The outcome of an episode or a training; a journal may say anything.
Outcome outcome_of(const AttemptRecord::Done& done) {
  for (const Outcome mishap : {Outcome::kError, Outcome::kTimedOut})
    if (done.outcome == to_string(mishap)) return mishap;
  return Outcome::kOk;
}

void count_done(const AttemptRecord& attempt, NodeStatus& node, Tally& tally) {
  for (const AttemptRecord::Done& done : attempt.done) {
    note_outcome(done.key, outcome_of(done), tally);
    ++node.done;
    node.errors += done.outcome == "error" ? 1 : 0;
    node.seconds += done.seconds;
  }
}

// A worker that was killed may have written a row that its journal does not know.
void count_rows(const AttemptRecord& attempt, Tally& tally) {
  LineFile lines(attempt.rows_file);
  while (const auto line = lines.next()) {
    const EpisodeRow row = scan_row(*line).row;
    note_outcome(row.key, row.outcome, tally);
  }
}

ShardState state_of(const ShardStatus& shard, bool training) {
  if (shard.done >= shard.episodes) return training && shard.errors > 0 ? ShardState::kFailed : ShardState::kDone;
  if (shard.running > 0) return ShardState::kRunning;
  return shard.attempts > 0 ? ShardState::kStopped : ShardState::kWaiting;
}

ShardStatus shard_status(const std::string& run, const Shard& shard, std::int64_t number, std::int64_t now,
                         RunStatus& status) {
  ShardStatus result;
  result.number = number;
  result.episodes = shard.episodes();
  Tally tally;
  for (const AttemptRecord& attempt : read_attempts(run, number)) {
    NodeStatus& node = status.nodes[attempt.header.node];
    // The pilot's rows were made before anybody began.
    if (attempt.end != "pilot") {
      ++result.attempts;
      ++node.attempts;
    }
    count_done(attempt, node, tally);
    if (attempt.end.empty() && status.kind == ShardPlan::Kind::kEpisodes) count_rows(attempt, tally);
    result.crashes += std::ssize(attempt.crashes);
    node.crashes += std::ssize(attempt.crashes);
    if (may_be_alive(attempt, now, kSilence)) {
      ++result.running;
      ++node.running;
      result.nodes.push_back(attempt.header.node);
    } else if (attempt.end.empty() && attempt.crashes.empty()) {
      ++node.lost;
    }
  }
  result.errors = std::ranges::count_if(tally, [](const auto& known) { return known.second == Outcome::kError; });
  result.timeouts = std::ranges::count_if(tally, [](const auto& known) { return known.second == Outcome::kTimedOut; });
  result.done = std::ssize(tally);
  result.state = state_of(result, status.kind == ShardPlan::Kind::kTrainings);
  return result;
}

// The time that is left by the plan, corrected by what was done, shared by those who are at work.
double seconds_left(const ShardPlan& plan, const RunStatus& status) {
  double planned = 0.0, taken = 0.0, left = 0.0;
  for (std::size_t i = 0; i < status.shards.size(); ++i) {
    const double share = static_cast<double>(status.shards[i].done) / static_cast<double>(status.shards[i].episodes);
    planned += plan.shards[i].cost * share;
    left += plan.shards[i].cost * (1.0 - share);
  }
  for (const auto& [name, node] : status.nodes) taken += node.seconds;
  if (status.running == 0 || planned <= 0.0) return -1.0;
  return left * (taken > 0.0 ? taken / planned : 1.0) / static_cast<double>(status.running);
}

std::string node_lines(const RunStatus& status) {
  std::string text;
  for (const auto& [name, node] : status.nodes)
    text += fmt::format(
        "  node {:<16} {:>8} done, {} with errors, {} working, {} attempts, {} lost, {} crashed, "
        "{:.2f} s an episode\n",
        name, node.done, node.errors, node.running, node.attempts, node.lost, node.crashes,
        node.done > 0 ? node.seconds / static_cast<double>(node.done) : 0.0);
  return text;
}

std::string shard_lines(const RunStatus& status) {
  std::string text;
  std::size_t lines = 0, more = 0;
  for (const ShardStatus& shard : status.shards) {
    if (shard.state == ShardState::kDone || shard.state == ShardState::kWaiting) continue;
    if (++lines > kMostShardLines) {
      ++more;
      continue;
    }
    text += fmt::format("  shard {}: {}, {} of {} done, {} attempts{}{}\n", shard.number, to_string(shard.state),
                        shard.done, shard.episodes, shard.attempts, shard.nodes.empty() ? "" : ", on ",
                        fmt::join(shard.nodes, ", "));
  }
  return more > 0 ? text + fmt::format("  and {} shards more\n", more) : text;
}

}  // namespace

std::string_view to_string(ShardState state) {
  switch (state) {
    case ShardState::kDone:
      return "done";
    case ShardState::kRunning:
      return "running";
    case ShardState::kFailed:
      return "failed";
    case ShardState::kStopped:
      return "stopped";
    case ShardState::kWaiting:
      break;
  }
  return "waiting";
}

std::string ranges_text(const std::vector<std::int64_t>& numbers) {
  std::vector<std::string> ranges;
  for (std::size_t begin = 0, end = 0; begin < numbers.size(); begin = end) {
    for (end = begin + 1; end < numbers.size() && numbers[end] == numbers[end - 1] + 1;) ++end;
    ranges.push_back(end - begin == 1 ? fmt::format("{}", numbers[begin])
                                      : fmt::format("{}-{}", numbers[begin], numbers[end - 1]));
  }
  return fmt::format("{}", fmt::join(ranges, ","));
}

std::string RunStatus::numbers(const std::vector<ShardState>& states) const {
  std::vector<std::int64_t> found;
  for (const ShardStatus& shard : shards)
    if (std::ranges::find(states, shard.state) != states.end()) found.push_back(shard.number);
  return ranges_text(found);
}

RunStatus run_status(const std::string& run) {
  const ShardPlan plan = read_shard_plan(run);
  RunStatus status;
  status.kind = plan.kind;
  status.episodes = plan.episodes;
  const std::int64_t now = file_system_time(run);
  for (std::size_t i = 0; i < plan.shards.size(); ++i) {
    status.shards.push_back(shard_status(run, plan.shards[i], static_cast<std::int64_t>(i), now, status));
    status.done += status.shards.back().done;
    status.errors += status.shards.back().errors;
    status.timeouts += status.shards.back().timeouts;
    status.running += status.shards.back().running;
  }
  status.seconds_left = seconds_left(plan, status);
  return status;
}

std::string status_text(const RunStatus& status) {
  const bool trainings = status.kind == ShardPlan::Kind::kTrainings;
  std::string text =
      fmt::format("{} of {} {} done, {} with errors{}; {} workers at it", status.done, status.episodes,
                  trainings ? "trainings" : "episodes", status.errors,
                  status.timeouts > 0 ? fmt::format(", {} timed out", status.timeouts) : "", status.running);
  if (status.seconds_left >= 0.0 && !status.is_complete())
    text += fmt::format(", about {} left", format_duration(status.seconds_left));
  text += "\nshards:";
  for (const ShardState state : kStates) {
    const auto count = std::ranges::count(status.shards, state, &ShardStatus::state);
    if (count == 0) continue;
    text += fmt::format(" {} {} ({})", count, to_string(state), status.numbers({state}));
  }
  return text + "\n" + node_lines(status) + shard_lines(status);
}

nlohmann::json status_json(const RunStatus& status) {
  nlohmann::json shards = nlohmann::json::array(), nodes = nlohmann::json::object();
  for (const ShardStatus& shard : status.shards)
    shards.push_back({{"shard", shard.number},
                      {"state", to_string(shard.state)},
                      {"episodes", shard.episodes},
                      {"done", shard.done},
                      {"errors", shard.errors},
                      {"timeouts", shard.timeouts},
                      {"attempts", shard.attempts},
                      {"running", shard.running},
                      {"crashes", shard.crashes},
                      {"nodes", shard.nodes}});
  for (const auto& [name, node] : status.nodes)
    nodes[name] = {{"done", node.done},         {"errors", node.errors}, {"running", node.running},
                   {"attempts", node.attempts}, {"lost", node.lost},     {"crashes", node.crashes},
                   {"seconds", node.seconds}};
  return {{"episodes", status.episodes},
          {"done", status.done},
          {"errors", status.errors},
          {"timeouts", status.timeouts},
          {"running", status.running},
          {"complete", status.is_complete()},
          {"seconds_left", status.seconds_left < 0.0 ? nlohmann::json(nullptr) : nlohmann::json(status.seconds_left)},
          {"unfinished",
           status.numbers({ShardState::kRunning, ShardState::kFailed, ShardState::kStopped, ShardState::kWaiting})},
          {"shards", shards},
          {"nodes", nodes}};
}

}  // namespace duet
