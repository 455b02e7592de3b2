#include <fmt/format.h>

#include <array>
#include <map>

#include "duet/core/episode_tags.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/report/studies/studies.h"
#include "duet/rows/groups/distinct_episodes.h"

namespace duet {
namespace {

constexpr std::array<std::string_view, 2> kPeople = {kRecordedPeople, kSyntheticPeople};

struct PeopleCounts {
  long n = 0, successes = 0, falls = 0;

  void add(const PeopleCounts& other) {
    n += other.n;
    successes += other.successes;
    falls += other.falls;
  }
};
using BothPeople = std::array<PeopleCounts, kPeople.size()>;
using PeopleByTask = std::map<std::pair<int, std::string>, BothPeople>;  // by rank and name

void add_people(const PolicyKey& key, const std::string& task, const BothPeople& counts, double level,
                Estimates& into) {
  const auto& [recorded, synthetic] = counts;
  EstimatesOf of = estimates_of(key, into);
  of.keys.task = task;
  of.add(
      "recorded_minus_synthetic", recorded.n + synthetic.n,
      make_rate(recorded.successes, recorded.n, level).rate - make_rate(synthetic.successes, synthetic.n, level).rate,
      newcombe_independent(recorded.successes, recorded.n, synthetic.successes, synthetic.n, level));
  for (std::size_t i = 0; i < kPeople.size(); ++i) {
    of.keys.of = kPeople[i];
    of.rate("success", make_rate(counts[i].successes, counts[i].n, level));
    of.rate("falls", make_rate(counts[i].falls, counts[i].n, level));
  }
}

Pivot people_pivot(double level) {
  Pivot pivot{.title = "Recorded and synthetic people", .rows = policy_rows({kTaskLabel}), .columns = {}};
  for (const auto& [people, title] : {std::pair("recorded", "Recorded [%]"), std::pair("synthetic", "Synthetic [%]")}) {
    const Estimate success{.of = people, .name = "success"};
    pivot.columns.insert(pivot.columns.end(), {column("n", success, as_n), column(title, success, as_percent),
                                               column("Fell [%]", {.of = people, .name = "falls"}, as_share)});
  }
  pivot.columns.push_back(column("Recorded - synthetic [points]", {.name = "recorded_minus_synthetic"}, as_points));
  pivot.notes = {
      fmt::format("Success under the headline detector with {0:g} % Wilson intervals; the difference with Newcombe's "
                  "{0:g} % interval for independent shares. Where both roles of a clip are run, its two episodes "
                  "resemble each other and the intervals are too narrow. The leaderboard counts both kinds together.",
                  100.0 * level)};
  return pivot;
}

}  // namespace

Analysis people_analysis(const std::vector<EpisodeRow>& rows, double level) {
  std::map<PolicyKey, PeopleByTask> policies;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    const auto people = std::ranges::find(kPeople, row->tags.text(kPeopleTag));
    if (row->perturbation != kClean || row->outcome == Outcome::kUnsupported || people == kPeople.end()) continue;
    policies[policy_key(*row)][{task_rank(row->task), row->task}][static_cast<std::size_t>(people - kPeople.begin())]
        .add({1, headline_success(*row) ? 1L : 0L, row->fell ? 1L : 0L});
  }
  Analysis analysis{.name = "people", .title = "Recorded and synthetic people", .level = level};
  for (const auto& [key, tasks] : policies) {
    BothPeople all;
    for (const auto& [task, counts] : tasks) {
      if (counts[0].n == 0 || counts[1].n == 0) continue;
      add_people(key, task.second, counts, level, analysis.estimates);
      for (std::size_t i = 0; i < all.size(); ++i) all[i].add(counts[i]);
    }
    if (all[0].n > 0) add_people(key, "all", all, level, analysis.estimates);
  }
  if (analysis.empty())
    analysis.notes = {"No run with recorded and synthetic people."};
  else
    analysis.tables = {table_of(analysis.estimates, people_pivot(level))};
  return analysis;
}

}  // namespace duet
