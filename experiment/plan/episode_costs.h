// The cost of an episode in each engine with each controller, and how much of a run's work is done: engines differ by a
// factor of twenty, so that counting episodes says nothing of the time that is left. Thread-safe.
#pragma once

#include <map>
#include <mutex>
#include <string>

#include "duet/experiment/plan/episode.h"

namespace duet {

// The name that costs are told apart by: "mujoco/vmc".
std::string cost_name(const EpisodeSpec& spec);

// The length of the motion that an episode follows, its start included. [s]
double motion_seconds(const EpisodeSpec& spec);

class EpisodeCosts {
 public:
  // Said of each episode that is to run, before any has ended.
  void expect(const EpisodeSpec& spec);
  // Such an episode has ended, after so much time of one core [s].
  void ended(const EpisodeSpec& spec, double wall_s);
  // Share of the work that is done, 0 to 1: what ended episodes took over that and what the rest will take at the mean
  // cost of its engine and controller so far. NaN until one of each has ended.
  [[nodiscard]] double share_done() const;

 private:
  struct Work {
    double left = 0.0, done = 0.0;  // motion [s]
    double wall = 0.0;              // that `done` took [s]
  };
  mutable std::mutex mutex_;
  std::map<std::string, Work> work_;
};

}  // namespace duet
