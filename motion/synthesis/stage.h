// Sets the scene: two bodies, their ways to each other and apart, and when everything happens.
#pragma once

#include "duet/core/task.h"
#include "duet/motion/synthesis/render.h"
#include "duet/motion/synthesis_options.h"
#include "duet/tasks/synthesis/act.h"

namespace duet::synthesis {

struct Staged {
  Scene scene;
  int frames = 0;
  Showing showing = {};
};

// Draws what `options` (already checked) leaves open and plans everything but the act's gestures. Throws
// std::invalid_argument where a duration was asked for that is too short for the ways and the act.
Staged set_stage(Task task, const SynthesisOptions& options, Draws& draws);

// A body of the stature given or drawn, its arms drawn as a share of the usual ones.
Body draw_body(const std::string& who, std::optional<double> height, Draws& draws, double shortest_arms = 0.97,
               double longest_arms = 1.03);

// The level direction that somebody of this yaw faces.
Eigen::Vector2d towards(double yaw);

// The four ends of the two ways. The middle between the two in the act is the origin, A sets out along +x.
struct Ways {
  std::array<Placement, 2> start, act;
};
Ways plan_ways(const Layout& layout, double distance, double angle, double share);

// A step or two backwards, beginning at 0. `by` [m].
Walk step_back(const Body& body, const Placement& from, double speed, double by);
Performer make_performer(const Body& body, const Ways& ways, int k, double style, Draws& draws);

// Makes people who turn round to leave stop looking at the partner; to be called once the act has been performed.
void look_away(Scene& scene);

}  // namespace duet::synthesis
