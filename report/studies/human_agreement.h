// People against detectors: how far raters agree with one another on episodes of a run, and how far each detector
// agrees with them (supplement C.3.2). An episode that fell or met an error is no success of any detector, as
// everywhere.
#pragma once

#include <string>
#include <vector>

#include "duet/report/tables/analysis.h"
#include "duet/rows/ratings.h"
#include "duet/statistics/rater_agreement.h"

namespace duet {

struct RaterPair {
  std::string a, b;
  Kappa kappa;  // of yes, no and unsure, over the episodes that both answered
};

// Agreement over episodes that the detector judged and people answered by yes or no, not unsure or without majority.
struct DetectorAgreement {
  std::string detector;  // "headline", "robot/paper": version and thresholds of the rows' verdicts
  std::vector<Kappa> raters;
  Kappa majority;
  Rate sensitivity, specificity;  // against the majority
};

struct DisputedEpisode {
  const EpisodeRow* row = nullptr;
  std::vector<std::string> answers;  // of each rater; "" for none
};

struct HumanAgreement {
  double level = 0.95;
  std::vector<std::string> raters;
  std::vector<long> answered;  // by each rater
  long episodes = 0;           // that anybody answered
  long yes = 0, no = 0;        // of them, by more than half of those who answered; others have no majority
  std::vector<RaterPair> pairs;
  Kappa all;  // Fleiss', over the episodes that all answered; n = 0 for fewer than three raters
  std::vector<DetectorAgreement> detectors;  // the headline, then by name
  std::vector<DisputedEpisode> disputes;     // not answered alike by all who answered; by task, clip and episode
};

// Intervals of kappas by resampling clips. Keeps pointers into `rows`, which hold every episode that was rated. Throws
// std::invalid_argument without a rater.
HumanAgreement human_agreement(const std::vector<EpisodeRow>& rows, const std::vector<Rater>& raters,
                               const IntervalOptions& options = {});

Analysis human_agreement_analysis(const HumanAgreement& agreement);

// Whole keys with task, clip and the answer of each rater.
nlohmann::json disputes_json(const HumanAgreement& agreement);

}  // namespace duet
