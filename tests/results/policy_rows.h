// Rows of policies for the tests of their tables.
#pragma once

#include <string>
#include <vector>

#include "tests/results/rows.h"

namespace duet::test {

struct PolicyEpisodes {
  std::string engine = "mujoco", controller = "vmc", policy = "dstar", perturbation = "clean", arm = "main",
              task = "hug";
  std::string successes = "1111";  // a digit per episode
  int first = 0;                   // number of the first
};

// With a verdict of the paper's detectors that is the opposite of the headline's.
inline void add_episodes(const PolicyEpisodes& of, std::vector<EpisodeRow>& rows) {
  int number = of.first;
  for (const char success : of.successes) {
    EpisodeRow row = episode(of.policy, of.task, number++, success == '1', of.arm);
    row.engine = of.engine;
    row.controller = of.controller;
    row.perturbation = of.perturbation;
    Verdict& verdict = row.verdicts.emplace_back();
    verdict.version = verdict.thresholds = "paper";
    verdict.success = success != '1';
    row.key = episode_key(row);
    rows.push_back(row);
  }
}

}  // namespace duet::test
