#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <set>
#include <span>

#include "duet/core/require.h"
#include "duet/report/studies/studies.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/statistics/rater_agreement.h"

namespace duet {
namespace {

// A category for each rated episode; below 0 where it has none.
using RatedColumn = std::vector<int>;
constexpr int kNone = -1, kNoCategory = static_cast<int>(Answer::kNo), kYesCategory = static_cast<int>(Answer::kYes);

struct RatedEpisodes {
  std::vector<const EpisodeRow*> rows;
  std::vector<int> clips;            // the cluster of each
  std::vector<RatedColumn> answers;  // of each rater
  RatedColumn majority;
};

int majority_of(const std::vector<RatedColumn>& answers, std::size_t episode) {
  int all = 0, yes = 0, no = 0;
  for (const RatedColumn& column : answers) {
    all += column[episode] != kNone ? 1 : 0;
    yes += column[episode] == kYesCategory ? 1 : 0;
    no += column[episode] == kNoCategory ? 1 : 0;
  }
  return 2 * yes > all ? kYesCategory : 2 * no > all ? kNoCategory : kNone;
}

RatedEpisodes rated_episodes(const std::vector<EpisodeRow>& rows, const std::vector<Rater>& raters) {
  RatedEpisodes rated;
  ClipNumbers clips;
  for (const EpisodeRow* row : in_episode_order(rows)) {
    if (std::ranges::none_of(raters, [&](const Rater& rater) { return rater.answers.contains(row->key); })) continue;
    rated.rows.push_back(row);
    rated.clips.push_back(clips.of(episode_id(*row)));
  }
  for (const Rater& rater : raters) {
    RatedColumn& column = rated.answers.emplace_back();
    for (const EpisodeRow* row : rated.rows) {
      const auto answer = rater.answers.find(row->key);
      column.push_back(answer == rater.answers.end() ? kNone : static_cast<int>(answer->second));
    }
  }
  for (std::size_t i = 0; i < rated.rows.size(); ++i) rated.majority.push_back(majority_of(rated.answers, i));
  return rated;
}

RatedColumn without_unsure(RatedColumn column) {
  std::ranges::replace(column, static_cast<int>(Answer::kUnsure), kNone);
  return column;
}

// Makes kappas over the episodes for which every column has a category.
class KappaMaker {
 public:
  KappaMaker(const std::vector<int>& clips, const IntervalOptions& options)
      : clips_(clips), level_(options.level), bootstrap_(options.resamples, options.seed) {}

  Kappa of(const std::vector<RatedColumn>& columns) {
    std::vector<std::vector<int>> common(columns.size());
    std::vector<int> clips;
    for (std::size_t i = 0; i < clips_.size(); ++i) {
      if (std::ranges::any_of(columns, [&](const RatedColumn& column) { return column[i] == kNone; })) continue;
      for (std::size_t k = 0; k < columns.size(); ++k) common[k].push_back(columns[k][i]);
      clips.push_back(clips_[i]);
    }
    return kappa_by_cluster(common, clips, bootstrap_, level_);
  }

 private:
  const std::vector<int>& clips_;
  double level_;
  ClusterBootstrap bootstrap_;
};

// The share of the majority's episodes of this category that the detector judges alike.
Rate share_alike(const RatedColumn& detector, const RatedEpisodes& rated, int category, double level) {
  std::vector<double> alike;
  std::vector<int> clips;
  for (std::size_t i = 0; i < detector.size(); ++i) {
    if (rated.majority[i] != category || detector[i] == kNone) continue;
    alike.push_back(detector[i] == category ? 1.0 : 0.0);
    clips.push_back(rated.clips[i]);
  }
  Rate rate = make_rate(std::ranges::count(alike, 1.0), static_cast<long>(alike.size()), level);
  if (rate.n > 0) rate.interval = wilson_by_clip(alike, clips, level);
  return rate;
}

constexpr const char* kHeadline = "headline";

std::vector<std::string> detectors_in(const std::vector<const EpisodeRow*>& rows) {
  std::set<std::string> names;
  for (const EpisodeRow* row : rows)
    for (const Verdict& verdict : row->verdicts) names.insert(verdict.version + '/' + verdict.thresholds);
  std::vector<std::string> list = {kHeadline};
  list.insert(list.end(), names.begin(), names.end());
  return list;
}

int judged_by(const std::string& detector, const EpisodeRow& row) {
  if (detector == kHeadline) return !row.success ? kNone : headline_success(row) ? kYesCategory : kNoCategory;
  for (const Verdict& verdict : row.verdicts)
    if (verdict.version + '/' + verdict.thresholds == detector)
      return verdict_success(row, verdict) ? kYesCategory : kNoCategory;
  return kNone;
}

void add_kappa(const std::string& of, const Kappa& kappa, Estimates& into) {
  const EstimatesOf estimates{{.of = of}, into};
  estimates.add("kappa", kappa.n, kappa.value, kappa.interval);
  estimates.add("agreed", kappa.n, kappa.agreed);
}

constexpr const char* kAllRaters = "all raters";
constexpr const char* kMajority = "majority";

std::string versus(const std::string& a, const std::string& b) { return fmt::format("{} vs {}", a, b); }

// Every two, and from three on all of them: Cohen's and Fleiss'.
void add_raters(const RatedEpisodes& rated, const std::vector<Rater>& raters, KappaMaker& kappas, Estimates& into) {
  for (std::size_t b = 1; b < raters.size(); ++b)
    for (std::size_t a = 0; a < b; ++a)
      add_kappa(versus(raters[a].name, raters[b].name), kappas.of({rated.answers[a], rated.answers[b]}), into);
  if (raters.size() > 2) add_kappa(kAllRaters, kappas.of(rated.answers), into);
}

void add_detector(const std::string& detector, const RatedEpisodes& rated, const std::vector<Rater>& raters,
                  double level, KappaMaker& kappas, Estimates& into) {
  RatedColumn judged;
  for (const EpisodeRow* row : rated.rows) judged.push_back(judged_by(detector, *row));
  for (std::size_t i = 0; i < raters.size(); ++i)
    add_kappa(versus(detector, raters[i].name), kappas.of({judged, without_unsure(rated.answers[i])}), into);
  const std::string of = versus(detector, kMajority);
  add_kappa(of, kappas.of({judged, rated.majority}), into);
  const EstimatesOf estimates{{.of = of}, into};
  estimates.rate("sensitivity", share_alike(judged, rated, kYesCategory, level));
  estimates.rate("specificity", share_alike(judged, rated, kNoCategory, level));
}

// Estimates stand in the order of `names`, two for each.
TitledTable raters_table(const Estimates& estimates, const std::vector<Rater>& raters, double level) {
  std::vector<std::string> names;
  for (std::size_t b = 1; b < raters.size(); ++b)
    for (std::size_t a = 0; a < b; ++a) names.push_back(fmt::format("{}, {}", raters[a].name, raters[b].name));
  if (raters.size() > 2) names.push_back(fmt::format("all {} (Fleiss)", raters.size()));
  TitledTable titled{.title = "Raters with one another",
                     .table = {.header = {"Raters", "n", "Same answer [%]", "Kappa"}}};
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Estimate &kappa = estimates[2 * i], &agreed = estimates[2 * i + 1];
    titled.table.rows.push_back({names[i], as_n(kappa), as_share(agreed), as_decimals(2)(kappa)});
  }
  titled.notes = {
      fmt::format("Answers yes, no and unsure. Of pairs Cohen's kappa, of all Fleiss'; {:g} % intervals by resampling "
                  "clips. A kappa is not defined (-) where everybody gave one and the same answer.",
                  100.0 * level)};
  if (raters.size() == 1) titled.notes = {"One rater alone: nobody to agree with."};
  return titled;
}

// Each detector has two estimates for each rater, two for the majority; sensitivity and specificity follow one another.
TitledTable detectors_table(const Estimates& estimates, const std::vector<std::string>& detectors,
                            const std::vector<Rater>& raters, const HumanAgreement& agreement) {
  TitledTable titled{.title = "Detectors with raters", .table = {.header = {"Detector"}}};
  for (const Rater& rater : raters) titled.table.header.push_back("Kappa with " + rater.name);
  for (const char* title : {"Kappa with the majority", "n", "Same [%]", "Sensitivity [%]", "Specificity [%]"})
    titled.table.header.emplace_back(title);
  const std::size_t majority = 2 * raters.size();
  for (std::size_t d = 0; d < detectors.size(); ++d) {
    const std::span<const Estimate> of = std::span(estimates).subspan(d * (majority + 4), majority + 4);
    std::vector<std::string>& cells = titled.table.rows.emplace_back(1, detectors[d]);
    for (std::size_t i = 0; i <= majority; i += 2) cells.push_back(as_decimals(2)(of[i]));
    cells.insert(cells.end(), {as_n(of[majority]), as_share(of[majority + 1]), as_percent(of[majority + 2]),
                               as_percent(of[majority + 3])});
  }
  titled.notes = {fmt::format(
      "A majority is more than half of those who answered: {} yes, {} no, {} without one. Unsure and no "
      "majority are left out here. Sensitivity and specificity with Wilson intervals by clip; a detector that "
      "always says the same has a kappa of 0, or none where people do, too.",
      agreement.yes, agreement.no, agreement.episodes - agreement.yes - agreement.no)};
  return titled;
}

std::string answer_text(int category) {
  return category == kNone ? "" : std::string(to_string(static_cast<Answer>(category)));
}

// Episodes that not all who answered gave the same answer, by task, clip and episode.
TitledTable disputes_table(const RatedEpisodes& rated, const std::vector<Rater>& raters, nlohmann::json& list) {
  TitledTable titled{.title = "", .table = {.header = {"Episode", "Task", "Clip"}, .rows = {}, .label_columns = 3}};
  for (const Rater& rater : raters) titled.table.header.push_back(rater.name);
  for (std::size_t i = 0; i < rated.rows.size(); ++i) {
    const EpisodeRow& row = *rated.rows[i];
    std::vector<std::string> cells = {row.key.substr(0, 16), row.task, row.clip};
    nlohmann::json answers = nlohmann::json::object();
    std::set<std::string> different;
    for (std::size_t k = 0; k < raters.size(); ++k) {
      const std::string answer = answer_text(rated.answers[k][i]);
      cells.push_back(answer.empty() ? "-" : answer);
      if (answer.empty()) continue;
      answers[raters[k].name] = answer;
      different.insert(answer);
    }
    if (different.size() < 2) continue;
    titled.table.rows.push_back(std::move(cells));
    list.push_back({{"episode", row.key}, {"task", row.task}, {"clip", row.clip}, {"answers", std::move(answers)}});
  }
  titled.title = fmt::format("Episodes in dispute ({})", titled.table.rows.size());
  if (titled.table.rows.empty()) titled.notes = {"All who answered an episode gave it the same answer."};
  return titled;
}

}  // namespace

HumanAgreement human_agreement(const std::vector<EpisodeRow>& rows, const std::vector<Rater>& raters,
                               const IntervalOptions& options) {
  require(!raters.empty(), "agreement: expected a rater, found none");
  const RatedEpisodes rated = rated_episodes(rows, raters);
  HumanAgreement agreement{.analysis = {.name = "human_agreement", .title = "People and detectors"},
                           .episodes = static_cast<long>(rated.rows.size()),
                           .yes = std::ranges::count(rated.majority, kYesCategory),
                           .no = std::ranges::count(rated.majority, kNoCategory),
                           .disputes = nlohmann::json::array()};
  Analysis& analysis = agreement.analysis;
  analysis.level = options.level;
  for (const Rater& rater : raters)
    if (static_cast<long>(rater.answers.size()) < agreement.episodes)
      analysis.notes.push_back(
          fmt::format("Rater {} answered {} of {} episodes.", rater.name, rater.answers.size(), agreement.episodes));
  KappaMaker kappas(rated.clips, options);
  add_raters(rated, raters, kappas, analysis.estimates);
  const std::vector<std::string> detectors = detectors_in(rated.rows);
  Estimates of_detectors;
  for (const std::string& detector : detectors)
    add_detector(detector, rated, raters, options.level, kappas, of_detectors);
  analysis.tables = {raters_table(analysis.estimates, raters, options.level),
                     detectors_table(of_detectors, detectors, raters, agreement),
                     disputes_table(rated, raters, agreement.disputes)};
  std::ranges::move(of_detectors, std::back_inserter(analysis.estimates));
  return agreement;
}

}  // namespace duet
