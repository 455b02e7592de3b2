// The board in words, as a table and as figures, and on the screen of a terminal.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "duet/core/require.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/report/ranking/ranking.h"
#include "duet/report/tables/text_table.h"
#include "duet/statistics/clustered.h"

namespace duet {
namespace {

std::string kind_of(const Ranking& board) {
  const auto count = static_cast<long>(board.rows.size());
  return board.of_oracles ? counted(count, "arm") + " that know the motion" : counted(count, "competitor");
}

// "94.8 [91.3, 96.9] % success (mujoco, 252 episodes)"
std::string success_text(const RankingRow& row) {
  const std::string episodes = counted(row.n, "episode");
  const std::string where = row.rates.size() > 1
                                ? fmt::format("mean over {} engines, {} each", row.rates.size(), episodes)
                                : fmt::format("{}, {}", row.rates.front().engine, episodes);
  return fmt::format("{} % success ({})", percent(row.mean, row.interval), where);
}

// "+3.6 [-0.7, 8.1] points over 126 clips (exact paired test by clip: p = 0.190)"
std::string difference_text(const RankingDifference& of) {
  return fmt::format("{} points over {} (exact paired test by clip: {})", points(of.difference, of.interval),
                     counted(of.clips, "clip"), p_text(of.p));
}

std::string too_few(const RankingDifference& of) {
  return fmt::format("{} {} too few clips to tell ({} are asked for)", of.clips, of.clips == 1 ? "is" : "are",
                     kFewestClips);
}

// The reason why a difference is no lead, as the end of a sentence.
std::string why_no_lead(const RankingDifference& of, double level) {
  const Told word = told(of, level);
  if (word == Told::kTestAlone)
    return "; the exact test alone would, but the interval, which is as wide as so many clips make it, holds 0, and "
           "both "
           "are asked for";
  if (word == Told::kIntervalAlone)
    return "; the interval alone would, but it is an approximation, and the exact test, which is none, is asked for, "
           "too";
  return "";
}

std::string first_sentence(const Ranking& board) {
  const RankingRow& first = board.rows.front();
  const std::string success = success_text(first);
  if (!board.lead) return fmt::format("{}: {}.", first.name(), success);
  const RankingDifference& lead = *board.lead;
  if (lead.clips == 0)
    return fmt::format("{} has {}, the most of {}; it shares no episode with {}, and nothing tells the two apart.",
                       first.name(), success, kind_of(board), lead.other);
  switch (told(lead, board.level)) {
    case Told::kAhead:
      return fmt::format("{} is best of {}: {}.", first.name(), kind_of(board), success);
    case Told::kTooFewClips:
      return fmt::format("Too few clips to rank {}: {} has {}.", kind_of(board), first.name(), success);
    case Told::kApart:
    case Told::kTestAlone:
    case Told::kIntervalAlone:
      break;
  }
  return fmt::format("{} {} of {}, {}, and cannot be told apart from {}.", first.name(),
                     board.rows[1].rank == 1 ? "is level with another at the head" : "has the most successes",
                     kind_of(board), success, lead.other);
}

std::string lead_sentence(const Ranking& board) {
  const RankingDifference& lead = *board.lead;
  switch (told(lead, board.level)) {
    case Told::kAhead:
      return fmt::format("It is ahead of {} by {}.", lead.other, difference_text(lead));
    case Told::kTooFewClips:
      return fmt::format("The difference to {} is {}: {}.", lead.other, difference_text(lead), too_few(lead));
    case Told::kApart:
    case Told::kTestAlone:
    case Told::kIntervalAlone:
      break;
  }
  return fmt::format("The difference to {} is {}: these clips do not decide between the two{}.", lead.other,
                     difference_text(lead), why_no_lead(lead, board.level));
}

std::string lift_sentence(const Ranking& board) {
  if (!board.lift || board.lift->clips == 0)
    return "No control was run beside it: success alone does not show that the robot took part.";
  const RankingDifference& lift = *board.lift;
  switch (told(lift, board.level)) {
    case Told::kAhead:
      return fmt::format("Its lift over the best control, {}, is {}.", lift.other, difference_text(lift));
    case Told::kTooFewClips:
      return fmt::format("Its lift over the best control, {}, is {}: {}.", lift.other, difference_text(lift),
                         too_few(lift));
    case Told::kApart:
    case Told::kTestAlone:
    case Told::kIntervalAlone:
      break;
  }
  return fmt::format("It does not win against the best control, {}: {}{}.", lift.other, difference_text(lift),
                     why_no_lead(lift, board.level));
}

// The sentence about the best arm that knows the motion, with the first row's controller.
std::string oracle_sentence(const Ranking& board) {
  for (const RankingRow& row : board.references)
    if (row.role.role == ArmRole::kOracle && row.controller == board.rows.front().controller)
      return fmt::format("For reference, {}: {} %.", row.name(), percent(row.mean, row.interval));
  return "";
}

std::string engines_sentence(const Ranking& board) {
  const RankingSpread& spread = *board.spread;
  const std::size_t engines = board.rows.front().rates.size();
  std::string text;
  if (spread.highest.rate == spread.lowest.rate)
    text = fmt::format("It has {} % in each of the {} engines", percent(spread.highest.rate), engines);
  else
    text = fmt::format("From engine to engine it has {} % ({}) to {} % ({}): {} than chance gives ({})",
                       percent(spread.lowest.rate), spread.lowest.engine, percent(spread.highest.rate),
                       spread.highest.engine, spread.p <= 1.0 - board.level ? "more" : "no more", p_text(spread.p));
  if (!board.won_by_another.empty())
    text += fmt::format("; another has more successes in {} of them ({})", board.won_by_another.size(),
                        fmt::join(board.won_by_another, ", "));
  return text + ".";
}

std::string rank_cell(const RankingRow& row) { return row.rank == 0 ? "-" : std::to_string(row.rank); }

std::string policy_cell(const RankingRow& row) {
  std::string text = row.perturbation == kClean ? row.policy : fmt::format("{}, {}", row.policy, row.perturbation);
  return row.role.word.empty() ? text : fmt::format("{} ({})", text, row.role.word);
}

std::string contact_text(const RankingRow& row) {
  if (!row.contact) return "-";
  return fmt::format(
      "{} of {}{}", row.contact->over, row.contact->touched,
      std::isfinite(row.contact->worst_ratio) ? fmt::format(" ({:.2f}x)", row.contact->worst_ratio) : "");
}

std::string rates_text(const RankingRow& row) {
  std::string text;
  for (const EngineRate& rate : row.rates)
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", rate.engine, percent(rate.rate));
  return text;
}

std::vector<const RankingRow*> all_rows(const Ranking& board) {
  std::vector<const RankingRow*> rows;
  for (const std::vector<RankingRow>* of : {&board.rows, &board.references})
    for (const RankingRow& row : *of) rows.push_back(&row);
  return rows;
}

TitledTable ranked_table(const Ranking& board) {
  TitledTable titled;
  titled.table.header = {"#",    "Controller", "Policy",     "Success [%]", "Null",
                         "Fell", "Unfinished", "Over limit", "By engine"};
  titled.table.label_columns = 3;
  for (const RankingRow* row : all_rows(board))
    titled.table.rows.push_back({rank_cell(*row), row->controller, policy_cell(*row), percent(row->mean, row->interval),
                                 percent(row->null_rate), std::to_string(row->fell), std::to_string(row->unfinished),
                                 contact_text(*row), rates_text(*row)});
  titled.notes = {fmt::format(
      "Equal means have one rank; \"-\" is an arm of reference, no competitor. Intervals of {:g} %: of a "
      "mean over engines Wilson's over clips, of one engine Wilson's over episodes, by clip where a clip "
      "has several episodes. A lead or a lift is claimed where the exact paired test by clip has p of at most "
      "{:.2g} over {} clips or more, and its interval leaves 0 out.",
      100.0 * board.level, 1.0 - board.level, kFewestClips)};
  return titled;
}

void add_difference_figures(const char* name, const RankingDifference& of, const Ranking& board,
                            const EstimatesOf& row) {
  EstimatesOf figures = row;
  figures.keys.of = of.other;
  figures.add(name, of.clips, of.difference, of.interval);
  figures.add(fmt::format("{}_p", name), of.clips, of.p);
  const Told word = told(of, board.level);
  figures.word(fmt::format("{}_told", name), word == Told::kAhead         ? "ahead"
                                             : word == Told::kTooFewClips ? "too few clips"
                                                                          : "not told apart");
}

constexpr const char* word_of(ArmRole role) {
  return role == ArmRole::kOracle ? "oracle" : role == ArmRole::kControl ? "control" : "competitor";
}

void add_board_figures(const Ranking& board, std::vector<Estimate>& into) {
  if (!board.suite.label.empty()) EstimatesOf{{}, into}.word("suite", board.suite.label);
  for (const std::string& sentence : ranking_verdict(board)) EstimatesOf{{}, into}.word("verdict", sentence);
  for (const RankingRow* row : all_rows(board)) {
    const EstimatesOf figures{{.engine = row->rates.size() > 1 ? "all" : row->rates.front().engine,
                               .controller = row->controller,
                               .policy = row->policy,
                               .arm = row->arm,
                               .perturbation = row->perturbation,
                               .task = "all"},
                              into};
    figures.word("role", word_of(row->role.role));
    if (row->rank > 0) figures.count("rank", {}, static_cast<long>(row->rank));
    figures.add("mean_success", row->n, row->mean, row->interval);
    if (row->rank == 0 || row != &board.rows.front()) continue;
    if (board.lead) add_difference_figures("lead", *board.lead, board, figures);
    if (board.lift) add_difference_figures("lift", *board.lift, board, figures);
    if (board.spread) figures.add("engine_spread_p", row->n, board.spread->p);
  }
}

// Lines of at most `width` bytes, broken at spaces; a word that is longer is cut.
std::vector<std::string> wrapped(const std::string& text, std::size_t width) {
  std::vector<std::string> lines;
  std::string rest = text;
  while (rest.size() > width) {
    std::size_t at = rest.rfind(' ', width);
    if (at == std::string::npos || at == 0) at = width;
    lines.push_back(rest.substr(0, at));
    rest.erase(0, rest[at] == ' ' ? at + 1 : at);
  }
  lines.push_back(rest);
  return lines;
}

struct ScreenColumn {
  const char* title;
  std::size_t width;  // at most
  bool left;
  std::string (*cell)(const RankingRow& row);
};
constexpr ScreenColumn kScreenTable[] = {
    {"#", 3, false, rank_cell},
    {"policy", 34, true, policy_cell},
    {"controller", 14, true, [](const RankingRow& row) { return row.controller; }},
    {"success [%]", 19, false, [](const RankingRow& row) { return percent(row.mean, row.interval); }},
    {"fell", 6, false, [](const RankingRow& row) { return std::to_string(row.fell); }},
    {"unfinished", 10, false, [](const RankingRow& row) { return std::to_string(row.unfinished); }}};

std::string screen_line(const std::function<std::string(const ScreenColumn&)>& cell) {
  std::string line;
  for (const ScreenColumn& column : kScreenTable)
    line += fmt::format(fmt::runtime(column.left ? "{}{:<{}}" : "{}{:>{}}"), line.empty() ? "" : "  ",
                        excerpt(cell(column), column.width), column.width);
  line.erase(line.find_last_not_of(' ') + 1);
  return line + "\n";
}

// Which rows fit: the best ones, and of the references as many as there is room for.
std::string screen_table(const Ranking& board, std::size_t lines) {
  const std::vector<const RankingRow*> rows = all_rows(board);
  std::size_t fits = rows.size(), ranked = board.rows.size(), others = board.references.size();
  if (rows.size() + 1 > lines) {
    fits = lines - 2;  // a line of titles, one that says what is left out
    others = std::min(others, std::max<std::size_t>(fits / 3, fits - std::min(fits, ranked)));
    ranked = fits - others;
  }
  std::string text = screen_line([](const ScreenColumn& column) { return column.title; });
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::size_t place = i < board.rows.size() ? i : i - board.rows.size();
    if (place >= (i < board.rows.size() ? ranked : others)) continue;
    text += screen_line([&](const ScreenColumn& column) { return column.cell(*rows[i]); });
  }
  if (fits < rows.size()) text += fmt::format("and {} more (--tables)\n", rows.size() - fits);
  return text;
}

}  // namespace

std::vector<std::string> ranking_verdict(const Ranking& board) {
  std::vector<std::string> sentences;
  if (!board.rows.empty()) {
    sentences = {first_sentence(board)};
    if (board.lead && board.lead->clips > 0) sentences.push_back(lead_sentence(board));
    sentences.push_back(lift_sentence(board));
    if (std::string oracle = oracle_sentence(board); !oracle.empty()) sentences.push_back(std::move(oracle));
    if (board.spread) sentences.push_back(engines_sentence(board));
  } else if (!board.references.empty()) {
    sentences = {"Nothing competes here: every arm is a control."};
  }
  if (!sentences.empty() && !board.suite.warning.empty()) sentences.push_back(board.suite.warning);
  return sentences;
}

Analysis ranking_analysis(const Ranking& board) {
  Analysis analysis{.name = kRankingName, .title = "Board", .level = board.level};
  if (!board.suite.label.empty()) analysis.title += ": " + board.suite.label;
  analysis.notes = ranking_verdict(board);
  if (analysis.notes.empty()) return analysis;
  analysis.tables = {ranked_table(board)};
  add_board_figures(board, analysis.estimates);
  return analysis;
}

std::string ranking_screen(const Ranking& board, const std::vector<std::string>& notes) {
  constexpr std::size_t kFewestTableLines = 5, kMostNoteLines = 4;
  std::vector<std::string> lines, verdict;
  for (const std::string& note : notes)
    for (std::string& line : wrapped(escape_markdown(note), kScreenColumns)) lines.push_back(std::move(line));
  if (lines.size() > kMostNoteLines) {
    lines.resize(kMostNoteLines);
    lines.back() = "... (--tables has all notes)";
  }
  for (const std::string& sentence : ranking_verdict(board))
    for (std::string& line : wrapped(escape_markdown(sentence), kScreenColumns)) verdict.push_back(std::move(line));
  const std::size_t room = kScreenLines - 1 - kFewestTableLines - lines.size();
  if (verdict.size() > room) {
    verdict.resize(room);
    verdict.back() = "... (--tables has all sentences)";
  }
  lines.insert(lines.end(), verdict.begin(), verdict.end());
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text + "\n" + screen_table(board, kScreenLines - 1 - lines.size());
}

}  // namespace duet
