// Sets the scene: two bodies, their ways to each other and apart, and when everything happens.
#pragma once

#include <array>

#include "duet/core/task.h"
#include "duet/motion/human_motion.h"
#include "duet/motion/synthesis_options.h"
#include "duet/tasks/synthesis/act.h"
#include "duet/tasks/synthesis/performer.h"

namespace duet::synthesis {

// From two performers to joints: pelvis heights that keep both legs within reach, then trunk, legs and arms frame by
// frame.

// The part of the scene's time that a clip shows: from `first` on, `tempo` seconds of it in each second of the clip.
struct RenderOptions {
  double first = 0.0;  // [s]
  double tempo = 1.0;
};

std::array<HumanMotion, 2> render(const std::array<Performer, 2>& people, int frames, double rate_hz,
                                  const RenderOptions& showing = {});

struct PlannedScene {
  Scene scene;
  int frames = 0;
  RenderOptions showing = {};
  bool still = false;  // B has no part in the act
};

// Draws what `options` (already checked) leaves open and plans everything but the act's gestures. Throws
// std::invalid_argument where a duration was asked for that is too short for the ways and the act.
PlannedScene set_stage(Task task, const SynthesisOptions& options, Draws& draws);

// A body of the stature given or drawn, its arms drawn as a share of the usual ones.
Body draw_body(const std::string& who, std::optional<double> height, Draws& draws, double shortest_arms = 0.97,
               double longest_arms = 1.03);

// The level direction that somebody of this yaw faces.
Eigen::Vector2d towards(double yaw);

// The four ends of the two ways. The middle between the two in the act is the origin, A sets out along +x.
struct ApproachPaths {
  std::array<Placement, 2> start, act;
};
ApproachPaths plan_ways(const Layout& layout, double distance, double angle, double share);

// A step or two backwards, beginning at 0. `by` [m].
Walk step_back(const Body& body, const Placement& from, double speed, double by);
Performer make_performer(const Body& body, const ApproachPaths& ways, int k, double style, Draws& draws);

// Makes people who turn round to leave stop looking at the partner; to be called once the act has been performed.
void look_away(Scene& scene);

// Sets the scene as recorded people do: two who stand close, a step or two, quick hands, a short touch; the clip is
// cropped to it. Some hesitate, some break off. Figures and their sources: docs/synthesis.md and the tasks' files.

// Draws what `options` (already checked) leaves open and plans everything but the act's gestures; who hesitates does so
// here. `outcome` says how the act ends.
PlannedScene set_people_stage(Task task, const SynthesisOptions& options, Draws& draws, ActOutcome& outcome);

// The manner in which people do a task; none of rehearsed ones.
const RecordedManner& manner_of(Task task, Likeness like);

// Once the act has been performed: some use the other hand, too.
void use_both_hands(const RecordedManner& manner, Scene& scene, Draws& draws);

// In place of the act's gestures: A, and perhaps B, reaches half way and draws back.
void perform_abort(Scene& scene, Draws& draws);

}  // namespace duet::synthesis
