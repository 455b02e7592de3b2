// The controller's effect on a reference and how well it follows it, per controller and engine: the figures of the
// supplement's Table S4 (A.4.6) before and after the controller, survival and faults. From the rows of one arm in
// physics engines; playback has no controller and is left out. Nothing depends on the order of rows.
#pragma once

#include <array>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/tables/analysis.h"
#include "duet/rows/episode_row.h"
#include "duet/statistics/statistics.h"

namespace duet {

// A metric of rows and how tables call it; `before`: of the reference, that is before the controller ("" where it is of
// both).
struct ControllerFigure {
  std::string_view metric, before, title, unit;
};
inline constexpr std::array<ControllerFigure, 7> kControllerFigures = {
    {{"hf_ratio", "hf_ratio_reference", "HF ratio", "1"},
     {"dof_jerk", "dof_jerk_reference", "DOF jerk", "rad/s^3"},
     {"root_jerk", "root_jerk_reference", "Root jerk", "m/s^3"},
     {"root_error", "", "e_root", "m"},
     {"root_angle_error", "", "e_root", "deg"},
     {"dof_error", "", "e_dof", "rad"},
     {"dof_velocity_error", "", "e_dof", "rad/s"}}};

struct Estimate {
  long n = 0;  // episodes that have it
  double mean = std::numeric_limits<double>::quiet_NaN();
  Interval interval = kNoInterval;  // none for fewer than two clips: one clip drawn again is always itself
};

// One (controller, engine, policy, perturbation).
struct ControllerEntry {
  std::string policy, perturbation, controller, engine;
  long n = 0;         // episodes, without those that are unsupported
  long survived = 0;  // ended as planned: not fallen, diverged, out of time or with an error
  Interval survival;  // Wilson
  long faulty = 0;    // episodes in which the controller met a number that is not finite
  long stopped = 0;   // of them, those that it ended with its safe stop
  long unsupported = 0;
  std::map<std::string, Estimate, std::less<>> figures;  // by metric; mean over episodes, bootstrap over clips
};

struct ControllerTable {
  double level = 0.95;
  std::vector<ControllerEntry> entries;  // by perturbation (clean first), policy, controller, engine
};

// Throws InputError: rows of two suites or suite versions, an episode that is there twice.
ControllerTable controller_table(const std::vector<EpisodeRow>& rows, const IntervalOptions& options = {},
                                 const std::string& arm = "main");

// Jitter before and after the controller; tracking, survival and faults. Each with the paper's rows at its end.
Analysis controller_analysis(const ControllerTable& table);

}  // namespace duet
