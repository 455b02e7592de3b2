// The order in which a run works that stops when its policies are told apart: clips in rounds, rounds in looks. It
// depends on the suite's seed and on the part that is asked for, not on threads or on what is in the folder, so that a
// suite stops at the same episode everywhere; each row is the one that the full run has.
#pragma once

#include <cstdint>
#include <vector>

#include "duet/experiment/plan/episode.h"
#include "duet/report/ranking/decision.h"

namespace duet {

struct DecisionSchedule {
  std::vector<std::vector<TaskClip>> rounds;
  std::vector<long> looks;                           // rounds that are over at each look
  std::vector<std::vector<std::uint32_t>> episodes;  // places in the plan, per look
};

// A look comes after so many episodes or more: enough for all cores to work between two of them.
inline constexpr std::size_t kEpisodesPerLook = 60;

// Throws InputError where the part has no episode.
DecisionSchedule decision_schedule(const EpisodePlan& plan, const RunPart& part, std::uint64_t seed,
                                   std::size_t episodes_per_look = kEpisodesPerLook);

// Rows of the part alone: a folder may hold other engines and perturbations as well.
std::vector<EpisodeRow> rows_of_part(std::vector<EpisodeRow> rows, const RunPart& part);

// Whether a look needs the episode: policies that are told apart already need none, the null arm runs beside the rest.
bool is_needed(const EpisodeSpec& spec, const Decision& so_far);

// A decision with what it took.
struct DecidedRun {
  Decision decision;
  std::int64_t planned = 0, used = 0;  // episodes of the part, and those up to the look that decided
  [[nodiscard]] std::int64_t saved() const { return planned - used; }
};
// A sentence per pair, then "decided: 126 of 378 episodes were used, 252 runs saved".
std::string decided_run_text(const DecidedRun& run);
nlohmann::json decided_run_json(const DecidedRun& run);  // what decision.json in a run directory says

}  // namespace duet
