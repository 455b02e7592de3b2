// Key frames of a clip as stick figures: an orthographic side view, in millimetres, at right angles to the line between
// the two agents and the same for all frames of a clip. The picture of a clip is a file of its own in a data set, too
// (datasets/curation.h), so that it is drawn here and not by the viewer of pages.
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

namespace duet {

struct StickFigure {
  std::string label;                       // "human", "robot", "source"
  std::vector<Eigen::Vector3d> points;     // [m], frame W
  std::vector<std::pair<int, int>> bones;  // indices in points
};
struct KeyFrame {
  std::string label;  // "start", "act", "end", with its time
  std::vector<StickFigure> figures;
};

// The frames side by side; "" where there are no points. Points that are not finite are left out, with their bones.
std::string key_frames_svg(const std::vector<KeyFrame>& frames);

}  // namespace duet
