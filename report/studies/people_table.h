// Recorded and synthetic people side by side: what each policy achieves with the one and with the other, from the rows
// of a run whose clips are of both kinds (suites/real.yaml). Clean episodes only; the null arm has lines of its own.
// Which clips are synthetic their ids say (core/synthetic_id.h). Nothing depends on the order of rows.
#pragma once

#include <string>
#include <vector>

#include "duet/report/ranking/policy_groups.h"
#include "duet/report/tables/analysis.h"

namespace duet {

struct PeopleRates {
  Rate success, falls;  // the suite's headline verdict; episodes with a fall
};

struct PeopleEntry {
  PolicyKey key;
  std::string task;  // "all": over the tasks that both kinds have
  PeopleRates recorded, synthetic;
  double difference = 0.0;  // success with recorded people minus that with synthetic ones
  Interval interval;        // Newcombe's method 10 for two independent shares
};

struct PeopleTable {
  double level = 0.95;
  std::vector<PeopleEntry> entries;  // by engine, controller, arm, policy, task; none where one kind is absent
};

// Throws InputError: rows of two suites or suite versions.
PeopleTable people_table(const std::vector<EpisodeRow>& rows, double level = 0.95);

Analysis people_analysis(const PeopleTable& table);

}  // namespace duet
