// What tasks have in common when two people do them: where the two stand for the act, and the scene that an act fills.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "duet/tasks/synthesis/draws.h"
#include "duet/tasks/synthesis/performer.h"

namespace duet::synthesis {

// Who takes part, before anybody is placed.
struct Cast {
  std::array<Body, 2> body;  // A, B
  int side = 1;              // of the acting hand: 0 left, 1 right
  double style = 0.5;
  std::optional<double> target_height;  // above the ground [m]
  double farthest = 2.0;                // largest root distance that leaves both a way to walk [m]
};

// How they stand to each other: A at the origin facing +x, B at (distance, lateral) facing -x. [m]
struct Layout {
  double distance = 1.0;
  double lateral = 0.0;
  Eigen::Vector3d meet = Eigen::Vector3d::Zero();  // where the hands meet, for acts that have such a point
  std::array<Lean, 2> lean;                        // of the trunks during the act
};

// Two joints within kTouchDistance of each other during [begin, end]. [s]
struct Touch {
  double begin = 0.0, end = 0.0;
  int joint_a = 0, joint_b = 0;
};

struct Scene {
  Cast cast;
  Layout layout;
  std::array<Performer, 2> people;
  double act_begin = 0.0;  // both stand [s]
  double act_end = 0.0;    // contact or gesture is over; arms go back until `release_end`
  double release_end = 0.0;
  std::vector<Touch> touches;
};

struct Act {
  double mean_seconds;       // of the whole clip; Table S6 for the supplement's tasks
  double shortest, longest;  // of the act [s]
  double release;            // until the arms hang again [s]
  double lowest, highest;    // target heights that may be asked for; equal where the task has none [m]
  double touch_distance;     // joints of a contact window are at most this far apart [m]; 0: no contact
  bool close;                // they stand so close that they must step back before they may turn
  Layout (*layout)(const Cast&, Draws&);
  void (*perform)(Scene&, Draws&);
};

// Point of a person's frame (origin on the floor below the root, x forward) in W.
Eigen::Vector3d in_world(const Placement& placement, const Eigen::Vector3d& point);
// The same point seen by A and by B of a layout.
Eigen::Vector3d seen_by(int person, const Layout& layout, const Eigen::Vector3d& point_of_a);

// Distance and leans for hands that meet at height `z`: each reaches with `share` of the arm, but neither less than
// `nearest` nor more than `farthest` in front of the own root.
Layout meeting_layout(const Cast& cast, double z, double share, double nearest, double farthest, const Lean& lean);

}  // namespace duet::synthesis
