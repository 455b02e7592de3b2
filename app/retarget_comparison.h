// The same clips retargeted in several ways, side by side: modes of PAIR, or its weights halved and doubled (Table S8).
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "duet/experiment/work/run_work.h"
#include "duet/motion/interaction_clip.h"
#include "duet/retarget/options.h"
#include "duet/robots/robot_model.h"

namespace duet {

using PairChoices = std::vector<std::pair<std::string, std::string>>;

struct RetargetVariant {
  std::string name;
  PairOptions options;
};

// Each mode with the choices that hold for all. Throws std::invalid_argument for an unknown mode.
std::vector<RetargetVariant> mode_variants(const std::vector<std::string>& modes, const PairChoices& choices);
// Table S8: as given, and each of kin, con, hum and reg (L_temp and L_pose together) times 0.5 and 2.
std::vector<RetargetVariant> weight_variants(const PairOptions& options);

// One figure over the clips: mean and worst (largest), of the clips that have a value.
struct ComparedFigure {
  double mean = 0.0, worst = 0.0;
};

struct ComparedVariant {
  std::string name;
  int clips = 0;
  double frames_per_second = 0.0;  // of one thread, from clip to PairedMotion
  // Figures of grounding_metrics; jpe, awd, large_angle_ratio.entry; contact_f1_* of the summed counts (mean alone).
  std::map<std::string, ComparedFigure> figures;
};

std::vector<ComparedVariant> compare_retargeting(const std::vector<InteractionClip>& clips,
                                                 const std::vector<RetargetVariant>& variants, const RobotModel& robot,
                                                 int threads, Progress& progress);

// A row a figure, a column a variant; "mean (worst)".
std::string comparison_table(const std::vector<ComparedVariant>& compared);
// A row a variant: JPE, AWD, F1 at the three thresholds, large angles.
std::string weights_table(const std::vector<ComparedVariant>& compared);
nlohmann::json comparison_json(const std::vector<ComparedVariant>& compared);

}  // namespace duet
