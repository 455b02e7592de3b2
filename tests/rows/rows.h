// Rows for the tests of this room.
#pragma once

#include <fstream>
#include <string>

#include "duet/rows/episode_row.h"
#include "duet/rows/folder/run_directory.h"

namespace duet::test {

inline void append_text(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary | std::ios::app) << text;
}

inline RunInfo tiny_run() {
  RunInfo info;
  info.suite = "tiny";
  info.suite_version = "1.0.0";
  info.suite_hash = "0123456789abcdef";
  info.suite_yaml = "name: tiny\nversion: 1.0.0\n";
  info.argv = {"duet", "run", "tiny.yaml"};
  info.created_at = "2026-01-02T03:04:05Z";
  info.environment = {{"machine", "a machine"}};
  info.policies = {{"null", ""}, {"replay", ""}};
  info.controllers = {{"vmc", ""}};
  return info;
}

// A row with every field set, none to its default.
inline EpisodeRow full_row() {
  EpisodeRow row;
  row.suite = "hhoi-core";
  row.suite_version = "1.0.0";
  row.suite_hash = std::string(64, 'a');
  row.task = "hug";
  row.clip = "hug-003";
  row.episode = 7;
  row.seed = 0xfedcba9876543210ULL;
  row.engine = "mujoco";
  row.engine_version = "2.2.2";
  row.engine_profile = "parity";
  row.profile_digest = std::string(64, 'd');
  row.controller = "wbc-sim";
  row.controller_digest = std::string(64, 'e');
  row.policy = "replay";
  row.policy_digest = std::string(64, 'f');
  row.detectors = "3";
  row.perturbation = "jitter_0.05";
  row.robot_digest = std::string(64, 'b');
  row.arm = "shuffled";
  row.outcome = Outcome::kFell;
  row.tags = RowTags({{std::string(kKindsTag), "jitter"}, {std::string(kSizeTag), "0.05"}});
  row.message = "pelvis below 0.3 m at 2.1 s, \"sideways\"\nμ = 0.8";
  row.success = true;
  row.verdicts = {{{.success = true,
                    .parts = {{"contact", true}, {"duration", false}},
                    .values = {{"distance", 0.1}},
                    .margins = {{"overall", -0.25}}},
                   "paper",
                   "strict",
                   31}};
  row.metrics = {{"jpe", 0.1 + 0.2}, {"hf_ratio", 1e-300}};
  row.fell = true;
  row.frames = 250;
  row.sim_s = 5.0;
  row.wall_s = 0.75;
  row.contact_peak_n = 81.5;
  row.contact_impulse_ns = 3.25;
  row.forces = {{"ground.mean_n", 343.125}, {"human.chest.quasi_static_n", 12.1 + 0.2}};
  row.contacts = {{{.begin_s = 1.25,
                    .duration_s = 0.1 + 0.2,
                    .peak_n = 81.5,
                    .impulse_ns = 3.25,
                    .depth_m = 0.00326,
                    .windowed_mean_n = 60.5},
                   "left_wrist_yaw_link",
                   "chest",
                   "chest_left"}};
  row.contacts_total = 19;
  row.trace = {
      .rate_hz = 12.5, .points = {"root", "left_hand"}, .mm = {{0, -1, 790, 210, 180, 900}, {1, 0, 789, 2, 3, 4}}};
  row.feet = {.rate_hz = 25.0, .left_mm = {0, 61, -1}, .right_mm = {4, 0, 0}};
  row.faults = {.observations = 3, .actions = 1, .stopped = true};
  row.late_plans = 2;
  row.policy_faults = {.late = 4, .invalid = 1, .dead = true, .message = "the process ended"};
  row.policy_ms = {.p50 = 1.5, .p95 = 0.1 + 0.2, .max = 80.0};
  row.state_hash = std::string(64, 'c');
  row.started_at = "2026-01-02T03:04:05Z";
  row.key = episode_key(row);
  return row;
}

// One episode of a small benchmark; its key follows from its identity.
inline EpisodeRow episode(const std::string& policy, const std::string& task, int number, bool success,
                          const std::string& arm = "main") {
  EpisodeRow row;
  row.suite = "tiny";
  row.suite_version = "1.0.0";
  row.suite_hash = "0123456789abcdef";
  row.task = task;
  row.clip = task + "-" + std::to_string(number / 3);
  row.episode = number;
  row.engine = "mujoco";
  row.controller = "vmc";
  row.policy = policy;
  row.arm = arm;
  row.success = success;
  row.key = episode_key(row);
  return row;
}

// The same in a physics engine of choice.
inline EpisodeRow engine_episode(const std::string& engine, const std::string& policy, int number, bool success,
                                 const std::string& controller = "vmc") {
  EpisodeRow row = episode(policy, "hug", number, success);
  row.engine = engine;
  row.controller = controller;
  row.key = episode_key(row);
  return row;
}

// The root at (x, 0, 0) mm in each frame, a hand at its side.
inline EpisodeRow traced(const std::string& engine, int number, const std::vector<int>& x_mm) {
  EpisodeRow row = engine_episode(engine, "replay", number, true);
  row.trace.points = {"root", "left_hand"};
  for (const int x : x_mm) row.trace.mm.push_back({x, 0, 0, 0, 300, 900});
  return row;
}

inline void set_tag(EpisodeRow& row, std::string_view name, const std::string& value) {
  Tags tags = row.tags.map();
  tags.insert_or_assign(std::string(name), value);
  row.tags = RowTags(std::move(tags));
}

}  // namespace duet::test
