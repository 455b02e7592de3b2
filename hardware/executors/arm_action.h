// Preset arm actions of the G1's maker: its service "arm" is told a number, and moves the arms over its own walking by
// the clock. Numbers and names are facts of its interface; the motions themselves are not published. Pure functions;
// thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "duet/core/task.h"

namespace duet {

struct ArmPreset {
  int id;
  std::string_view name;  // as the maker has it
  Task task;              // that it is of
  double lasts;           // of ours (the control `vendor`), until the arms hang again [s]
};
// Those of tasks that are ours; the maker has others, and none for a bow.
inline constexpr std::array<ArmPreset, 6> kArmPresets = {{{13, "right kiss", Task::kFlyKiss, 3.0},
                                                          {18, "high five", Task::kHighFive, 20.8},
                                                          {19, "hug", Task::kHug, 20.8},
                                                          {25, "face wave", Task::kWave, 5.8},
                                                          {26, "high wave", Task::kWave, 5.8},
                                                          {27, "shake hand", Task::kHandshake, 20.8}}};
// Answers of the service other than 0.
inline constexpr std::int32_t kArmsOccupied = 7400, kArmsHeld = 7401, kUnknownAction = 7402, kNotWalking = 7404;

// Null for a number that is none.
const ArmPreset* arm_preset(int id);
// Throws std::invalid_argument with the known names.
const ArmPreset& arm_preset(const std::string& name);

}  // namespace duet
