#include "duet/results/analyses/board.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "duet/results/analyses/leaderboard_rows.h"
#include "duet/results/analyses/text_table.h"
#include "duet/results/statistics/row_groups.h"

namespace duet {
namespace {

constexpr int kLeadResamples = 10000;
constexpr std::uint64_t kLeadSeed = 1;
constexpr const char* kCleanPerturbation = "clean";

bool is_of(const BoardRow& row, const std::string& controller, const std::string& policy,
           const std::string& perturbation) {
  return row.controller == controller && row.policy == policy && row.perturbation == perturbation;
}

BoardRow row_of(const EngineSuccess& success) {
  BoardRow row;
  std::tie(row.controller, row.policy, row.perturbation) =
      std::tie(success.controller, success.policy, success.perturbation);
  row.n = success.n;
  row.mean = success.mean;
  row.interval = success.mean_interval;
  row.rates = success.engines;
  row.playback = success.playback;
  row.sd = success.sd;
  row.noise_sd = success.noise_sd;
  return row;
}

// One physics engine, or none.
BoardRow row_of(const LeaderboardEntry& entry) {
  BoardRow row;
  std::tie(row.controller, row.policy, row.perturbation) = std::tie(entry.controller, entry.policy, entry.perturbation);
  row.n = entry.n;
  row.mean = entry.success;
  row.interval = entry.interval;
  row.rates = {{entry.engine, entry.n, entry.k, entry.success, entry.interval}};
  row.sd = row.noise_sd = std::nan("");
  return row;
}

std::vector<BoardRow> bare_rows(const std::vector<LeaderboardEntry>& entries, const CrossEngine& engines) {
  std::vector<BoardRow> rows;
  if (engines.engines.size() > 1) {
    for (const EngineSuccess& success : engines.success)
      if (success.n > 0) rows.push_back(row_of(success));
    return rows;
  }
  const auto is_physics = [](const LeaderboardEntry& entry) { return entry.engine != kPlaybackEngine; };
  const bool physics = std::ranges::any_of(entries, is_physics);
  for (const LeaderboardEntry& entry : entries)
    if (entry.task == "all" && entry.arm == "main" && is_physics(entry) == physics) rows.push_back(row_of(entry));
  return rows;
}

// From the leaderboard, over the physics engines of the row.
void add_outcomes(const std::vector<LeaderboardEntry>& entries, BoardRow& row) {
  double null_sum = 0.0;
  long nulls = 0;
  for (const LeaderboardEntry& entry : entries) {
    if (entry.task != "all" || entry.arm != "main" || !is_of(row, entry.controller, entry.policy, entry.perturbation))
      continue;
    if (std::ranges::find(row.rates, entry.engine, &EngineRate::engine) == row.rates.end()) continue;
    row.fell += entry.fell;
    row.unfinished += entry.diverged + entry.timed_out + entry.errors + entry.unsupported;
    if (!std::isfinite(entry.null_success)) continue;
    null_sum += entry.null_success;
    ++nulls;
  }
  row.null_rate = nulls == 0 ? std::nan("") : null_sum / static_cast<double>(nulls);
}

void add_contact(const ContactTable& contacts, BoardRow& row) {
  for (const ContactGroup& group : contacts.groups) {
    if (group.controller != row.controller || group.policy != row.policy) continue;
    BoardContact contact;
    contact.episodes = group.all.episodes;
    contact.worst_ratio = std::nan("");
    for (const RegionContacts& region : group.all.regions) {
      if (region.region != kAnyRegion) continue;
      contact.touched = region.touched;
      contact.over = region.over;
      contact.worst_ratio = region.ratio;
    }
    row.contact = contact;
  }
}

bool has_rate(const BoardRow& row, const std::string& engine) {
  return std::ranges::find(row.rates, engine, &EngineRate::engine) != row.rates.end();
}

// Pairs by engine, task, clip and episode.
std::optional<BoardLead> lead_of(const std::vector<EpisodeRow>& rows, const BoardRow& first, const BoardRow& second) {
  std::map<std::tuple<std::string, EpisodeId>, std::pair<int, int>> pairs;  // -1: not run
  for (const EpisodeRow& row : rows) {
    if (row.arm != "main" || !has_rate(first, row.engine) || !has_rate(second, row.engine)) continue;
    const bool of_first = is_of(first, row.controller, row.policy, row.perturbation);
    if (!of_first && !is_of(second, row.controller, row.policy, row.perturbation)) continue;
    auto& pair = pairs.try_emplace({row.engine, episode_id(row)}, -1, -1).first->second;
    (of_first ? pair.first : pair.second) = headline_success(row) ? 1 : 0;
  }
  std::vector<double> differences;
  std::vector<int> clips;
  ClipNumbers numbers;
  for (const auto& [id, pair] : pairs) {
    if (pair.first < 0 || pair.second < 0) continue;
    differences.push_back(pair.first - pair.second);
    clips.push_back(numbers.of(std::get<1>(id)));
  }
  if (differences.empty()) return std::nullopt;
  BoardLead lead;
  for (const double difference : differences) lead.difference += difference / static_cast<double>(differences.size());
  lead.interval = cluster_bootstrap(differences, clips, kLeadResamples, kLeadSeed);
  lead.clips = static_cast<long>(numbers.size());
  return lead;
}

std::string best_sentence(const Board& board) {
  const BoardRow& best = board.rows.front();
  const std::string where = board.engines > 1
                                ? fmt::format("mean over {} engines, {} episodes each", board.engines, best.n)
                                : fmt::format("{}, {} episodes", best.rates.front().engine, best.n);
  if (board.rows.size() == 1)
    return fmt::format("{}: {} % success ({}).", best.name(), percent(best.mean, best.interval), where);
  return fmt::format("{} is best of {}: {} % success ({}).", best.name(), board.rows.size(),
                     percent(best.mean, best.interval), where);
}

std::string lead_sentence(const Board& board) {
  const BoardLead& lead = *board.lead;
  const std::string next = board.rows[1].name();
  const std::string size = fmt::format("{} points over {} clips", points(lead.difference, lead.interval), lead.clips);
  if (lead.interval.low > 0.0) return fmt::format("It is ahead of {} by {}: more than chance gives.", next, size);
  return fmt::format("Its lead over {} is {}: these clips do not decide between the two.", next, size);
}

std::string engines_sentence(const Board& board) {
  const BoardRow& best = board.rows.front();
  const auto [low, high] = std::ranges::minmax_element(best.rates, {}, &EngineRate::rate);
  std::string text =
      fmt::format("The engine {}: from {} % in {} to {} % in {} for it, {} chance alone would give",
                  best.sd > best.noise_sd ? "matters" : "hardly matters", percent(low->rate), low->engine,
                  percent(high->rate), high->engine, best.sd > best.noise_sd ? "more than" : "no more than");
  if (std::isfinite(board.winner_changes))
    text += fmt::format("; another engine names another winner with probability {:.2f}", board.winner_changes);
  return text + ".";
}

std::string null_sentence(const Board& board) {
  double most = 0.0;
  for (const BoardRow& row : board.rows)
    if (std::isfinite(row.null_rate)) most = std::max(most, row.null_rate);
  if (most <= 0.0) return "";
  return fmt::format("A robot that stands still passes up to {} % by the same detector.", percent(most));
}

std::string rates_text(const BoardRow& row) {
  std::string text;
  for (const EngineRate& rate : row.rates)
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", rate.engine, percent(rate.rate));
  return text;
}

std::string contact_text(const BoardRow& row) {
  if (!row.contact) return "-";
  return fmt::format(
      "{} of {}{}", row.contact->over, row.contact->touched,
      std::isfinite(row.contact->worst_ratio) ? fmt::format(" ({:.2f}x)", row.contact->worst_ratio) : "");
}

}  // namespace

std::string BoardRow::name() const {
  const std::string pair = fmt::format("{} with {}", controller, policy);
  return perturbation == kCleanPerturbation ? pair : fmt::format("{} under {}", pair, perturbation);
}

Board board(const std::vector<EpisodeRow>& rows, const std::vector<LeaderboardEntry>& entries,
            const CrossEngine& engines, const ContactTable& contacts) {
  Board made;
  made.rows = bare_rows(entries, engines);
  made.engines = static_cast<long>(engines.engines.size());
  made.winner_changes = std::nan("");
  for (const RankStability& ranks : engines.ranks)
    if (ranks.of == "combinations") made.winner_changes = ranks.winner_changes;
  const auto is_clean = [](const BoardRow& row) { return row.perturbation == kCleanPerturbation; };
  if (std::ranges::any_of(made.rows, is_clean))
    std::erase_if(made.rows, [&](const BoardRow& row) { return !is_clean(row); });
  for (BoardRow& row : made.rows) {
    add_outcomes(entries, row);
    add_contact(contacts, row);
  }
  std::ranges::stable_sort(made.rows, [](const BoardRow& a, const BoardRow& b) {
    return a.mean != b.mean ? a.mean > b.mean : a.name() < b.name();
  });
  if (made.rows.size() > 1) made.lead = lead_of(rows, made.rows[0], made.rows[1]);
  return made;
}

std::vector<std::string> board_verdict(const Board& board) {
  std::vector<std::string> sentences;
  if (board.rows.empty()) return sentences;
  sentences.push_back(best_sentence(board));
  if (board.lead) sentences.push_back(lead_sentence(board));
  if (board.engines > 1) sentences.push_back(engines_sentence(board));
  if (const std::string still = null_sentence(board); !still.empty()) sentences.push_back(still);
  return sentences;
}

std::string board_markdown(const Board& board) {
  if (board.rows.empty()) return "";
  std::string text;
  for (const std::string& sentence : board_verdict(board)) text += escape_markdown(sentence) + "\n";
  TextTable table{
      {"#", "Controller", "Policy", "Success [%]", "Null", "Fell", "Unfinished", "Over limit", "By engine"}, {}, 3};
  for (std::size_t i = 0; i < board.rows.size(); ++i) {
    const BoardRow& row = board.rows[i];
    table.rows.push_back({std::to_string(i + 1), row.controller,
                          row.perturbation == kCleanPerturbation ? row.policy : row.policy + ", " + row.perturbation,
                          percent(row.mean, row.interval), percent(row.null_rate), std::to_string(row.fell),
                          std::to_string(row.unfinished), contact_text(row), rates_text(row)});
  }
  return text + "\n" + markdown_table(table);
}

}  // namespace duet
