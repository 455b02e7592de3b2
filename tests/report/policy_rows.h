// Rows of policies for the tests of their tables.
#pragma once

#include <string>
#include <vector>

#include "tests/rows/rows.h"

namespace duet::test {

struct PolicyEpisodes {
  std::string engine = "mujoco", controller = "vmc", policy = "dstar", perturbation = "clean", arm = "main",
              task = "hug";
  std::string successes = "1111";  // a digit per episode
  int first = 0;                   // number of the first
  Tags tags = {};
};

// With a verdict of the paper's detectors that is the opposite of the headline's.
inline void add_episodes(const PolicyEpisodes& of, std::vector<EpisodeRow>& rows) {
  int number = of.first;
  for (const char success : of.successes) {
    EpisodeRow row = episode(of.policy, of.task, number++, success == '1', of.arm);
    row.engine = of.engine;
    row.controller = of.controller;
    row.perturbation = of.perturbation;
    row.tags = RowTags(of.tags);
    Verdict& verdict = row.verdicts.emplace_back();
    verdict.version = verdict.thresholds = "paper";
    verdict.success = success != '1';
    row.key = episode_key(row);
    rows.push_back(row);
  }
}

// Tags of a perturbation's size.
inline Tags size_tags(const std::string& family, double x, const std::string& unit, const std::string& beside = "") {
  return {{std::string(kKindsTag), family},
          {std::string(kFamilyTag), family},
          {std::string(kSizeTag), std::to_string(x)},
          {std::string(kUnitTag), unit},
          {std::string(kBesideTag), beside}};
}

}  // namespace duet::test
