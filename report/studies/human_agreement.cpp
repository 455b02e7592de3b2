#include "duet/report/studies/human_agreement.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <set>

#include "duet/core/require.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/report/tables/cells.h"
#include "duet/rows/groups/row_groups.h"

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

DetectorAgreement agreement_of(const std::string& detector, const RatedEpisodes& rated, double level,
                               KappaMaker& kappas) {
  RatedColumn judged;
  for (const EpisodeRow* row : rated.rows) judged.push_back(judged_by(detector, *row));
  DetectorAgreement agreement;
  agreement.detector = detector;
  agreement.majority = kappas.of({judged, rated.majority});
  for (const RatedColumn& answers : rated.answers)
    agreement.raters.push_back(kappas.of({judged, without_unsure(answers)}));
  agreement.sensitivity = share_alike(judged, rated, kYesCategory, level);
  agreement.specificity = share_alike(judged, rated, kNoCategory, level);
  return agreement;
}

std::vector<DisputedEpisode> disputes_of(const RatedEpisodes& rated) {
  std::vector<DisputedEpisode> disputes;
  for (std::size_t i = 0; i < rated.rows.size(); ++i) {
    DisputedEpisode episode{.row = rated.rows[i], .answers = {}};
    std::set<int> different;
    for (const RatedColumn& column : rated.answers) {
      episode.answers.emplace_back(column[i] == kNone ? "" : to_string(static_cast<Answer>(column[i])));
      if (column[i] != kNone) different.insert(column[i]);
    }
    if (different.size() > 1) disputes.push_back(std::move(episode));
  }
  return disputes;
}

std::string kappa_cell(const Kappa& kappa) { return decimals(kappa.value, kappa.interval, 2); }

TitledTable raters_table(const HumanAgreement& agreement) {
  TitledTable titled{.title = "Raters with one another"};
  titled.table.header = {"Raters", "n", "Same answer [%]", "Kappa"};
  const auto add = [&](const std::string& name, const Kappa& kappa) {
    titled.table.rows.push_back({name, std::to_string(kappa.n), percent(kappa.agreed), kappa_cell(kappa)});
  };
  for (const RaterPair& pair : agreement.pairs) add(fmt::format("{}, {}", pair.a, pair.b), pair.kappa);
  if (agreement.raters.size() > 2) add(fmt::format("all {} (Fleiss)", agreement.raters.size()), agreement.all);
  titled.notes = {
      fmt::format("Answers yes, no and unsure. Of pairs Cohen's kappa, of all Fleiss'; {:g} % intervals by resampling "
                  "clips. A kappa is not defined (-) where everybody gave one and the same answer.",
                  100.0 * agreement.level)};
  if (agreement.raters.size() == 1) titled.notes = {"One rater alone: nobody to agree with."};
  return titled;
}

TitledTable detectors_table(const HumanAgreement& agreement) {
  TitledTable titled{.title = "Detectors with raters"};
  titled.table.header = {"Detector"};
  for (const std::string& rater : agreement.raters) titled.table.header.push_back("Kappa with " + rater);
  for (const char* column : {"Kappa with the majority", "n", "Same [%]", "Sensitivity [%]", "Specificity [%]"})
    titled.table.header.emplace_back(column);
  for (const DetectorAgreement& detector : agreement.detectors) {
    std::vector<std::string>& cells = titled.table.rows.emplace_back(1, detector.detector);
    for (const Kappa& kappa : detector.raters) cells.push_back(kappa_cell(kappa));
    cells.push_back(kappa_cell(detector.majority));
    cells.push_back(std::to_string(detector.majority.n));
    cells.push_back(percent(detector.majority.agreed));
    cells.push_back(rate_cell(detector.sensitivity));
    cells.push_back(rate_cell(detector.specificity));
  }
  titled.notes = {fmt::format(
      "A majority is more than half of those who answered: {} yes, {} no, {} without one. Unsure and no "
      "majority are left out here. Sensitivity and specificity with Wilson intervals by clip; a detector that "
      "always says the same has a kappa of 0, or none where people do, too.",
      agreement.yes, agreement.no, agreement.episodes - agreement.yes - agreement.no)};
  return titled;
}

TitledTable disputes_table(const HumanAgreement& agreement) {
  TitledTable titled{.title = fmt::format("Episodes in dispute ({})", agreement.disputes.size())};
  titled.table.header = {"Episode", "Task", "Clip"};
  titled.table.label_columns = 3;
  titled.table.header.insert(titled.table.header.end(), agreement.raters.begin(), agreement.raters.end());
  for (const DisputedEpisode& episode : agreement.disputes) {
    std::vector<std::string> cells = {episode.row->key.substr(0, 16), episode.row->task, episode.row->clip};
    for (const std::string& answer : episode.answers) cells.push_back(answer.empty() ? "-" : answer);
    titled.table.rows.push_back(std::move(cells));
  }
  if (agreement.disputes.empty()) titled.notes = {"All who answered an episode gave it the same answer."};
  return titled;
}

void add_kappa(const std::string& of, const Kappa& kappa, std::vector<Figure>& into) {
  FiguresOf figures{Figure{.of = of}, into};
  figures.add("kappa", kappa.n, kappa.value, kappa.interval);
  figures.add("agreed", kappa.n, kappa.agreed);
}

void add_detector_figures(const DetectorAgreement& detector, const std::vector<std::string>& raters,
                          std::vector<Figure>& into) {
  for (std::size_t i = 0; i < raters.size(); ++i)
    add_kappa(fmt::format("{} vs {}", detector.detector, raters[i]), detector.raters[i], into);
  const std::string of = detector.detector + " vs majority";
  add_kappa(of, detector.majority, into);
  FiguresOf figures{Figure{.of = of}, into};
  figures.rate("sensitivity", detector.sensitivity);
  figures.rate("specificity", detector.specificity);
}

}  // namespace

HumanAgreement human_agreement(const std::vector<EpisodeRow>& rows, const std::vector<Rater>& raters,
                               const IntervalOptions& options) {
  require(!raters.empty(), "agreement: expected a rater, found none");
  const RatedEpisodes rated = rated_episodes(rows, raters);
  KappaMaker kappas(rated.clips, options);
  HumanAgreement agreement;
  agreement.level = options.level;
  agreement.episodes = static_cast<long>(rated.rows.size());
  agreement.yes = std::ranges::count(rated.majority, kYesCategory);
  agreement.no = std::ranges::count(rated.majority, kNoCategory);
  for (const Rater& rater : raters) {
    agreement.raters.push_back(rater.name);
    agreement.answered.push_back(static_cast<long>(rater.answers.size()));
  }
  for (std::size_t b = 1; b < raters.size(); ++b)
    for (std::size_t a = 0; a < b; ++a)
      agreement.pairs.push_back({raters[a].name, raters[b].name, kappas.of({rated.answers[a], rated.answers[b]})});
  agreement.all.agreed = agreement.all.value = std::numeric_limits<double>::quiet_NaN();
  if (raters.size() > 2) agreement.all = kappas.of(rated.answers);
  for (const std::string& detector : detectors_in(rated.rows))
    agreement.detectors.push_back(agreement_of(detector, rated, options.level, kappas));
  agreement.disputes = disputes_of(rated);
  return agreement;
}

Analysis human_agreement_analysis(const HumanAgreement& agreement) {
  Analysis analysis{.name = "human_agreement", .title = "People and detectors", .level = agreement.level};
  for (std::size_t i = 0; i < agreement.raters.size(); ++i)
    if (agreement.answered[i] < agreement.episodes)
      analysis.notes.push_back(fmt::format("Rater {} answered {} of {} episodes.", agreement.raters[i],
                                           agreement.answered[i], agreement.episodes));
  analysis.tables = {raters_table(agreement), detectors_table(agreement), disputes_table(agreement)};
  for (const RaterPair& pair : agreement.pairs)
    add_kappa(fmt::format("{} vs {}", pair.a, pair.b), pair.kappa, analysis.figures);
  if (agreement.raters.size() > 2) add_kappa("all raters", agreement.all, analysis.figures);
  for (const DetectorAgreement& detector : agreement.detectors)
    add_detector_figures(detector, agreement.raters, analysis.figures);
  return analysis;
}

nlohmann::json disputes_json(const HumanAgreement& agreement) {
  nlohmann::json list = nlohmann::json::array();
  for (const DisputedEpisode& episode : agreement.disputes) {
    nlohmann::json answers = nlohmann::json::object();
    for (std::size_t i = 0; i < agreement.raters.size(); ++i)
      if (!episode.answers[i].empty()) answers[agreement.raters[i]] = episode.answers[i];
    list.push_back({{"episode", episode.row->key},
                    {"task", episode.row->task},
                    {"clip", episode.row->clip},
                    {"answers", std::move(answers)}});
  }
  return list;
}

}  // namespace duet
