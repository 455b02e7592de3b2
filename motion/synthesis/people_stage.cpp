#include "duet/motion/synthesis/people_stage.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/tasks/task_definition.h"

namespace duet::synthesis {
namespace {

// Chosen, not measured: SBU's recordings are of acts that were asked for and done. The three of its 18 handshakes in
// which no hands meet are what there is to say of acts that come to nothing.
constexpr double kHesitantShare = 0.10, kAbortedShare = 0.08;
constexpr double kMostReaction = 0.6;   // of the planned motion: the acts leave no more [s]
constexpr double kQuickestWalk = 0.55;  // two steps, however short [s]
constexpr double kShortestStep = 0.05;  // less is no walk [m]
constexpr double kBegin = 30.0;         // of the scene's time, so that nothing lies before 0 [s]
// Kinect's arms end before SMPL's; its people are students (docs/synthesis.md).
constexpr double kShortestArms = 0.90, kLongestArms = 1.02;

Hold half_way() { return from_shoulder({0.55, -0.02, -0.35}, {-0.4, 0.45, -1.0}, 0.05); }

bool stretches_arms(Task task) { return task != Task::kBend; }

Cast draw_cast(Task task, const SynthesisOptions& options, Draws& draws) {
  const RecordedManner& recorded = definition_of(task).act.recorded;
  const std::optional<bool> left =
      options.side ? std::optional<bool>(*options.side == Side::kLeft) : std::optional<bool>();
  Cast cast;
  cast.body = {draw_body("a.", options.height_a, draws, kShortestArms, kLongestArms),
               draw_body("b.", options.height_b, draws, kShortestArms, kLongestArms)};
  cast.side = draws.chance("left_handed", recorded.left, left) ? 0 : 1;
  cast.style = draws.uniform("style", 0.0, 1.0, options.style);
  cast.target_height = options.target_height;
  cast.manner.rehearsed = false;
  cast.manner.tempo = draws.spread("tempo", recorded.tempo);
  if (recorded.distance.middle > 0.0) cast.manner.distance = draws.spread("act.apart", recorded.distance);
  for (const int k : {0, 1}) {
    const std::string who(kWho[k]);
    if (recorded.turn.middle > 0.0) cast.manner.turn[k] = draws.spread(who + "turn", recorded.turn);
    cast.manner.bearing[k] = draws.spread(who + "bearing", recorded.bearing) - cast.manner.turn[k];
  }
  return cast;
}

// How long the act is, at tempo 1. [s]
double draw_act(const Act& act, double tempo, Draws& draws) {
  const RecordedManner& recorded = act.recorded;
  if (recorded.touch.middle > 0.0)
    return recorded.until_touch + tempo * std::max(0.05, draws.spread("touch", recorded.touch));
  if (recorded.act.middle > 0.0) return draws.spread("act", recorded.act);
  return draws.uniform("act", act.shortest, 0.6 * act.shortest + 0.4 * act.longest);
}

// The four ends of the two ways, the middle between the two in the act at the origin: each comes straight to its place,
// from where it has turned by half of `angle`.
Ways people_ways(const Layout& layout, double way, double angle, double share) {
  Ways ways;
  ways.act[1] = {Eigen::Vector2d(layout.distance, layout.lateral), std::numbers::pi + layout.turn};
  for (Placement& place : ways.act) place.position -= 0.5 * Eigen::Vector2d(layout.distance, layout.lateral);
  for (const int k : {0, 1}) {
    ways.start[k] = ways.act[k];
    ways.start[k].yaw += 0.5 * angle;
    ways.start[k].position -= (k == 0 ? share : 1.0 - share) * way * towards(ways.start[k].yaw);
  }
  return ways;
}

// The share of the way that A walks.
double draw_share(double stands, Draws& draws) {
  const bool a_stands = draws.chance("a.stands", stands), b_stands = draws.chance("b.stands", stands);
  const double share = draws.uniform("a.share_of_way", 0.35, 0.65);
  return b_stands ? 1.0 : a_stands ? 0.0 : share;
}

Walk slowed_down(Walk walk, double tempo, double begin) {
  const double seconds = std::max(walk.end - walk.begin, kQuickestWalk * tempo);
  walk.begin = begin;
  walk.end = begin + seconds;
  return walk;
}

void give_walk(Performer& person, const Placement& to, double speed, double tempo, double begin) {
  const Placement from = person.gait.root(kBegin);
  if ((to.position - from.position).norm() < kShortestStep) return;
  person.gait.walk(slowed_down(plan_walk(person.body, from, to, speed / tempo, 0.0), tempo, begin));
}

double walked_until(const Performer& person) {
  return person.gait.walks().empty() ? kBegin : person.gait.walks().back().end;
}

// Some step back when it is over, in the same moment as the hands.
void give_leave(Performer& person, double begin, double speed, double tempo, const std::string& who, Draws& draws) {
  if (!draws.chance(who + "leaves", 0.8)) return;
  const double by = draws.uniform(who + "back", 0.12, 0.45);
  person.gait.walk(slowed_down(step_back(person.body, person.gait.root(begin), speed / tempo, by), tempo, begin));
}

// A half-raised hand (a half bow) that waits before the act begins; the act goes on from there.
void hesitate(Task task, Scene& scene, Draws& draws) {
  constexpr double kUp = 0.7;  // [s]
  const double wait = draws.uniform("hesitates", 0.4, 1.2) * scene.cast.manner.tempo;
  const double end = scene.act_begin - 1.0;  // a hug opens the arms before it begins
  Performer& person = scene.people[0];
  if (!stretches_arms(task)) {
    Lean half;
    half.forward = 0.4 * scene.layout.lean[0].forward;
    person.lean_to(end - wait - kUp, end - wait, half);
    return;
  }
  person.arms[scene.cast.side].to(end - wait - kUp, end - wait, half_way());
}

ActOutcome draw_outcome(const SynthesisOptions& options, Draws& draws) {
  const double u = draws.stream("outcome").uniform();
  const ActOutcome drawn = u < kAbortedShare                    ? ActOutcome::kAborted
                           : u < kAbortedShare + kHesitantShare ? ActOutcome::kHesitant
                                                                : ActOutcome::kComplete;
  return options.outcome.value_or(drawn);
}

// Crops the clip as recordings are, or to the time asked for before the first step and after the last.
void crop(const Act& act, const SynthesisOptions& options, double last, Staged& staged, Draws& draws) {
  const Scene& scene = staged.scene;
  const double tempo = scene.cast.manner.tempo;
  const double touch = scene.act_begin + act.recorded.until_touch;
  const double before = draws.spread("before", act.recorded.before), after = draws.spread("after", act.recorded.after);
  // All that moves before the act: hands open for a hug, or hesitate, up to three seconds ahead of it.
  const double first = std::min(kBegin, scene.act_begin - 3.0 - tempo);
  staged.showing.tempo = tempo;
  staged.showing.first = options.before ? first - tempo * *options.before : touch - tempo * std::max(0.1, before);
  const double end = options.after ? last + tempo * *options.after : scene.act_end + tempo * std::max(0.05, after);
  staged.frames = std::max(5, static_cast<int>(std::lround((end - staged.showing.first) / tempo * options.rate_hz)));
}

}  // namespace

Staged set_people_stage(Task task, const SynthesisOptions& options, Draws& draws, ActOutcome& outcome) {
  const Act& act = definition_of(task).act;
  Cast cast = draw_cast(task, options, draws);
  const double tempo = cast.manner.tempo;
  const Layout layout = act.layout(cast, draws);
  const double roots = std::hypot(layout.distance, layout.lateral);
  draws.record("act.distance", roots);
  const double drawn_way = std::max(0.0, draws.spread("way", act.recorded.way));
  const double way = options.distance ? std::max(0.0, *options.distance - roots) : drawn_way;
  const double angle = draws.uniform("angle", -0.15, 0.15, options.angle);
  Ways ways = people_ways(layout, way, angle, draw_share(act.recorded.stands, draws));
  for (const int k : {0, 1})
    if ((ways.act[k].position - ways.start[k].position).norm() < kShortestStep) ways.start[k] = ways.act[k];

  Staged staged{.scene = Scene{cast,
                               layout,
                               {make_performer(cast.body[0], ways, 0, cast.style, draws),
                                make_performer(cast.body[1], ways, 1, cast.style, draws)},
                               0.0,
                               0.0,
                               0.0,
                               {}}};
  Scene& scene = staged.scene;
  const double speed = options.speed.value_or(std::max(0.3, draws.spread("speed", act.recorded.speed)));
  const double later = draws.uniform("b.starts_later", 0.0, 0.3) * tempo;
  double arrive = kBegin;
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    person.meets_skin = true;
    person.reaction =
        k == 0 ? 0.0 : std::clamp(draws.spread("b.reaction", act.recorded.reaction) * tempo, 0.0, kMostReaction);
    give_walk(person, ways.act[k], speed, tempo, kBegin + k * later);
    arrive = std::max(arrive, walked_until(person));
  }
  scene.act_begin = arrive - std::max(0.0, draws.spread("overlap", act.recorded.overlap)) * tempo;
  // An embrace closes when B's arms do.
  scene.act_end = scene.act_begin + draw_act(act, tempo, draws) + (act.close ? scene.people[1].reaction : 0.0);
  scene.release_end = scene.act_end + act.release;
  double last = scene.release_end;
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    give_leave(person, std::max(scene.act_end + 0.1 * tempo, walked_until(person)), speed, tempo, std::string(kWho[k]),
               draws);
    last = std::max(last, walked_until(person));
  }
  outcome = draw_outcome(options, draws);
  if (outcome == ActOutcome::kHesitant) hesitate(task, scene, draws);
  crop(act, options, last, staged, draws);
  return staged;
}

void perform_abort(Scene& scene, Draws& draws) {
  const double tempo = scene.cast.manner.tempo;
  const double held = draws.uniform("abort.held", 0.1, 0.6) * tempo;
  const bool both = draws.chance("abort.both", 0.5);
  for (const int k : {0, 1}) {
    if (k == 1 && !both) break;
    Performer& person = scene.people[k];
    const double begin = scene.act_begin + person.reaction, up = begin + 0.8, down = up + held;
    Lean half = scene.layout.lean[k];
    half.forward *= 0.4;
    person.lean_to(begin, up, half);
    person.hips.to(begin, up, 0.4 * half.hips);
    person.lean_to(down, down + 0.9, {});
    person.hips.to(down, down + 0.9, 0.0);
    person.arms[scene.cast.side].to(begin, up, half_way());
    person.arms[scene.cast.side].rest(down, down + 0.9);
  }
}

}  // namespace duet::synthesis
