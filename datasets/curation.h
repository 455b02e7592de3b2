// The four gates of supplement B.2 as explicit criteria: each is a figure of a clip, its limit and the frame where it
// is worst. The limits are a table that a person can change; how each was found stands in docs/datasets.md. Pure.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/motion/interaction_clip.h"

namespace duet {

enum class Gate { kMotionFidelity, kInteractionClarity, kKinematicFeasibility, kTemporalCompleteness };
std::string_view to_string(Gate gate);  // "motion fidelity", ...
std::span<const Gate> all_gates();

struct CriterionInfo {
  std::string_view name;  // "joint_speed", for limits and files
  Gate gate;
  std::string_view title;  // "fastest joint, but for two frames"
  std::string_view unit;
  double limit;
  bool at_most;  // the figure may be at most the limit; else at least
};
std::span<const CriterionInfo> curation_criteria();

// Limits of the criteria, by name; those that are not named have the table's.
struct CurationOptions {
  std::map<std::string, double> limits = {};
  // How much limbs' bones change in the usual recording of this source (median of bone_change); 0: not known. A tracker
  // whose bones change more than others' is allowed kOfSource of what is usual for it, where `limits` does not name it.
  double source_bone_change = 0.0;
  std::vector<Gate> gates = {all_gates().begin(), all_gates().end()};
};
// "joint_speed=8". Throws std::invalid_argument for an unknown criterion (with the known ones) or a value that is no
// finite number.
void set_limit(CurationOptions& options, const std::string& name, const std::string& value);

struct CriterionFinding {
  const CriterionInfo* criterion = nullptr;
  double value = 0.0;
  double limit = 0.0;
  int worst_frame = 0;
  bool passed = true;
};

struct CurationResult {
  std::vector<CriterionFinding> findings;  // of the gates asked for, in the table's order

  [[nodiscard]] bool passed() const;
  // The gates that refuse it, in the table's order, each once.
  [[nodiscard]] std::vector<Gate> refused_by() const;
  // "fastest joint, but for two frames: 14.2 m/s, expected at most 8 (frame 120)", one for each criterion that fails.
  [[nodiscard]] std::vector<std::string> reasons() const;
  // Where the criterion that fails by the largest factor is worst; 0 where none fails.
  [[nodiscard]] int worst_frame() const;
};

// The figure of the criterion "bone_change".
double limb_bone_change(const InteractionClip& clip);

CurationResult curate(const InteractionClip& clip, const CurationOptions& options = {});

// Two people as stick figures: what a person looks at to see why a clip was refused.

// These frames side by side, seen from the side, as one SVG that stands alone (no style sheet, no script). The one whom
// the robot replaces is drawn in the robot's colour. Throws std::invalid_argument for a frame outside the clip.
std::string clip_picture_svg(const InteractionClip& clip, const std::vector<int>& frames, const std::string& title);

}  // namespace duet
