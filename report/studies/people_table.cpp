#include "duet/report/studies/people_table.h"

#include <fmt/format.h>

#include <map>
#include <tuple>

#include "duet/core/episode_tags.h"
#include "duet/rows/groups/distinct_episodes.h"

namespace duet {
namespace {

struct PeopleCounts {
  long n = 0, successes = 0, falls = 0;

  void add(const PeopleCounts& other) {
    n += other.n;
    successes += other.successes;
    falls += other.falls;
  }
};

struct BothPeople {
  PeopleCounts recorded, synthetic;
};

using PeopleByTask = std::map<std::pair<int, std::string>, BothPeople>;  // by rank and name

PeopleRates people_rates(const PeopleCounts& counts, double level) {
  return {make_rate(counts.successes, counts.n, level), make_rate(counts.falls, counts.n, level)};
}

PeopleEntry people_entry(const PolicyKey& key, const std::string& task, const BothPeople& counts, double level) {
  PeopleEntry entry{.key = key,
                    .task = task,
                    .recorded = people_rates(counts.recorded, level),
                    .synthetic = people_rates(counts.synthetic, level),
                    .interval = {}};
  entry.difference = entry.recorded.success.rate - entry.synthetic.success.rate;
  entry.interval = newcombe_independent(counts.recorded.successes, counts.recorded.n, counts.synthetic.successes,
                                        counts.synthetic.n, level);
  return entry;
}

void add_people(const PolicyKey& key, const PeopleByTask& tasks, PeopleTable& table) {
  BothPeople all;
  for (const auto& [task, counts] : tasks) {
    if (counts.recorded.n == 0 || counts.synthetic.n == 0) continue;
    table.entries.push_back(people_entry(key, task.second, counts, table.level));
    all.recorded.add(counts.recorded);
    all.synthetic.add(counts.synthetic);
  }
  if (all.recorded.n > 0) table.entries.push_back(people_entry(key, "all", all, table.level));
}

std::vector<std::string> people_cells(const PeopleRates& rates) {
  return {count_cell(rates.success.n), rate_cell(rates.success), percent(rates.falls.rate)};
}

TitledTable people_rows(const PeopleTable& table) {
  TitledTable titled = labelled_table("Recorded and synthetic people", labels_of(table.entries));
  titled.table.header.insert(titled.table.header.end(), {"Task", "n", "Recorded [%]", "Fell [%]", "n", "Synthetic [%]",
                                                         "Fell [%]", "Recorded - synthetic [points]"});
  ++titled.table.label_columns;
  for (std::size_t i = 0; i < table.entries.size(); ++i) {
    const PeopleEntry& entry = table.entries[i];
    std::vector<std::string>& cells = titled.table.rows[i];
    cells.push_back(task_title(entry.task));
    for (const PeopleRates* rates : {&entry.recorded, &entry.synthetic})
      for (std::string& cell : people_cells(*rates)) cells.push_back(std::move(cell));
    cells.push_back(points(entry.difference, entry.interval));
  }
  titled.notes = {
      fmt::format("Success under the headline detector with {0:g} % Wilson intervals; the difference with Newcombe's "
                  "{0:g} % interval for independent shares. Where both roles of a clip are run, its two episodes "
                  "resemble each other and the intervals are too narrow. The leaderboard counts both kinds together.",
                  100.0 * table.level)};
  return titled;
}

void add_people_figures(const PeopleEntry& entry, std::vector<Figure>& into) {
  FiguresOf figures = figures_of(entry.key, into);
  figures.keys.task = entry.task;
  figures.add("recorded_minus_synthetic", entry.recorded.success.n + entry.synthetic.success.n, entry.difference,
              entry.interval);
  for (const auto& [people, rates] :
       {std::pair("recorded", &entry.recorded), std::pair("synthetic", &entry.synthetic)}) {
    figures.keys.of = people;
    figures.rate("success", rates->success);
    figures.rate("falls", rates->falls);
  }
}

}  // namespace

PeopleTable people_table(const std::vector<EpisodeRow>& rows, double level) {
  std::map<PolicyKey, PeopleByTask> policies;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    if (row->perturbation != kClean || row->outcome == Outcome::kUnsupported) continue;
    const std::string& people = row->tags.text(kPeopleTag);
    if (people != kSyntheticPeople && people != kRecordedPeople) continue;
    BothPeople& both =
        policies[{row->engine, row->controller, row->arm, row->policy}][{task_rank(row->task), row->task}];
    (people == kSyntheticPeople ? both.synthetic : both.recorded)
        .add({1, headline_success(*row) ? 1L : 0L, row->fell ? 1L : 0L});
  }
  PeopleTable table{.level = level, .entries = {}};
  for (const auto& [key, tasks] : policies) add_people(key, tasks, table);
  return table;
}

Analysis people_analysis(const PeopleTable& table) {
  Analysis analysis{.name = "people", .title = "Recorded and synthetic people", .level = table.level};
  if (table.entries.empty()) {
    analysis.notes = {"No run with recorded and synthetic people."};
    return analysis;
  }
  analysis.tables = {people_rows(table)};
  for (const PeopleEntry& entry : table.entries) add_people_figures(entry, analysis.figures);
  return analysis;
}

}  // namespace duet
