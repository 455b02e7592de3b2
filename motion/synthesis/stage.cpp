#include "duet/motion/synthesis/stage.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/require.h"
#include "duet/tasks/task_definition.h"

namespace duet::synthesis {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kLead = 0.4, kSettle = 0.3,
                 kTail = 0.4;         // least time standing: before, before the act, at the end [s]
constexpr double kShortestWay = 0.6;  // both ways together [m]

}  // namespace

Body draw_body(const std::string& who, std::optional<double> height, Draws& draws, double shortest_arms,
               double longest_arms) {
  Random stature = draws.stream(who + "height");
  const double usual = std::clamp(1.71 + 0.10 * stature.normal(), 1.5, 1.95);
  const double h = height.value_or(usual);
  draws.record(who + "height", h);
  Proportions proportions;
  proportions.legs = draws.uniform(who + "legs", 0.975, 1.025);
  proportions.arms = draws.uniform(who + "arms", shortest_arms, longest_arms);
  proportions.shoulders = draws.uniform(who + "shoulders", 0.94, 1.06);
  proportions.hips = draws.uniform(who + "hips", 0.94, 1.06);
  return make_body(h, proportions);
}

Eigen::Vector2d towards(double yaw) { return {std::cos(yaw), std::sin(yaw)}; }

Ways plan_ways(const Layout& layout, double distance, double angle, double share) {
  Ways ways;
  const double way_a = share * (distance - layout.distance);
  ways.start[0] = {Eigen::Vector2d::Zero(), 0.0};
  ways.act[0] = {way_a * towards(0.5 * angle), angle};
  const Eigen::Rotation2Dd axis(angle);
  ways.act[1] = {ways.act[0].position + axis * Eigen::Vector2d(layout.distance, layout.lateral),
                 angle + std::numbers::pi};
  // B comes along an arc too: it sets out as far off the chord as it turns on the way.
  ways.start[1].position = distance * towards(angle);
  const Eigen::Vector2d chord = ways.act[1].position - ways.start[1].position;
  const double along = std::atan2(chord.y(), chord.x());
  ways.start[1].yaw = along - turn_between(along, ways.act[1].yaw);
  const Eigen::Vector2d middle = 0.5 * (ways.act[0].position + ways.act[1].position);
  for (Placement* end : {&ways.start[0], &ways.start[1], &ways.act[0], &ways.act[1]}) end->position -= middle;
  return ways;
}

Walk step_back(const Body& body, const Placement& from, double speed, double by) {
  Placement to = from;
  to.position -= by * towards(from.yaw);
  return plan_walk(body, from, to, 0.6 * speed, 0.0);
}

namespace {

Walk later(Walk walk, double by) {
  walk.begin += by;
  walk.end += by;
  return walk;
}

Walk draw_step_back(const Body& body, const Placement& from, double speed, const std::string& who, Draws& draws) {
  Walk walk = step_back(body, from, speed, draws.uniform(who + "back", 0.5, 0.9));
  walk.first_foot = draws.chance(who + "back.left_first", 0.5) ? 0 : 1;
  return walk;
}

Walk turn_away(const Body& body, const Placement& from, double speed, const std::string& who, Draws& draws) {
  const double turn = draws.uniform(who + "turn", 125.0 * kDegree, 170.0 * kDegree);
  const double sign = draws.chance(who + "turn.left", 0.5) ? 1.0 : -1.0;
  Placement to;
  to.yaw = from.yaw + sign * turn;
  const double way = draws.uniform(who + "away", 0.9, 1.7);
  to.position = from.position + way * towards(to.yaw);
  Walk walk = plan_walk(body, from, to, 0.85 * speed, 0.0);
  walk.bulge.setZero();
  walk.to.yaw = to.yaw;  // plan_walk turns the short way round, which is the same
  walk.turned_by = 0.55;
  walk.moves_from = 0.3;
  walk.end = std::max(walk.end / (1.0 - walk.moves_from), 3.0);
  choose_steps(body, 0.85 * speed, walk);
  walk.first_foot = sign > 0.0 ? 0 : 1;
  return walk;
}

// The walks after the act, beginning at 0; the short version steps back and stays.
std::vector<Walk> plan_leave(const Body& body, const Placement& from, double speed, const std::string& who, bool close,
                             bool brief, Draws& draws) {
  const bool turns = draws.chance(who + "leaves.turning", 0.65) && !brief;
  const bool backs = draws.chance(who + "leaves.backwards", 0.3) || close || !turns;
  draws.record(who + "leaves.turning", turns ? "yes" : "no");
  draws.record(who + "leaves.backwards", backs ? "yes" : "no");
  std::vector<Walk> walks;
  if (backs) walks.push_back(draw_step_back(body, from, speed, who, draws));
  if (turns) {
    const Placement here = backs ? walks.back().to : from;
    const double begin = backs ? walks.back().end + 0.15 : 0.0;
    walks.push_back(later(turn_away(body, here, speed, who, draws), begin));
  }
  return walks;
}

// Everything whose length is fixed before the spare time is shared out. [s]
struct Timing {
  std::array<Walk, 2> approach;                 // A's begins at 0
  std::array<std::vector<Walk>, 2> leave;       // A's begins at 0
  std::array<double, 2> reaction = {0.0, 0.0};  // of A and B; only B reacts
  double arrive = 0.0;                          // both stand, from A's first step
  double leaving = 0.0;

  [[nodiscard]] double fixed(const Act& act) const {
    return kLead + arrive + kSettle + act.shortest + act.release + leaving + kTail;
  }
};

Timing plan_timing(const Act& act, const Scene& scene, const Ways& ways, std::array<double, 2> speed, bool brief,
                   Draws& draws) {
  Timing timing;
  timing.reaction[1] = draws.uniform("b.reaction", 0.18, 0.42);
  const double later_start = draws.uniform("b.starts_later", 0.0, 0.7);
  for (const int k : {0, 1}) {
    const Body& body = scene.cast.body[k];
    timing.approach[k] = plan_walk(body, ways.start[k], ways.act[k], speed[k], k * later_start);
    timing.leave[k] = plan_leave(body, ways.act[k], speed[k], std::string(kWho[k]), act.close, brief, draws);
    for (Walk& walk : timing.leave[k]) walk = later(walk, timing.reaction[k]);
    timing.arrive = std::max(timing.arrive, timing.approach[k].end);
    timing.leaving = std::max(timing.leaving, timing.leave[k].back().end);
  }
  return timing;
}

struct Clock {
  double first_step, act_begin, act_end, release_end, seconds;
};

// Shares the spare time out: some to the act, the rest to standing before, in between and after.
Clock share_out(const Act& act, const Timing& timing, double seconds, Draws& draws) {
  const double spare = seconds - timing.fixed(act);
  const double more_act = std::min(draws.uniform("share.act", 0.45, 0.75) * spare, act.longest - act.shortest);
  const double idle = spare - more_act;
  const double settle = kSettle + std::min(0.12 * idle, 0.7);
  Clock clock;
  clock.seconds = seconds;
  clock.first_step = kLead + draws.uniform("share.lead", 0.25, 0.55) * idle;
  clock.act_begin = clock.first_step + timing.arrive + settle;
  clock.act_end = clock.act_begin + act.shortest + more_act;
  clock.release_end = clock.act_end + act.release;
  return clock;
}

double draw_seconds(const Act& act, const SynthesisOptions& options, Draws& draws) {
  return draws.uniform("duration", 0.8 * act.mean_seconds, 1.2 * act.mean_seconds, options.duration);
}

}  // namespace

Performer make_performer(const Body& body, const Ways& ways, int k, double style, Draws& draws) {
  const std::string who(kWho[k]);
  const double outward = draws.uniform(who + "arms.outward", 0.10, 0.17);
  const double upright = draws.uniform(who + "arms.plumb", 0.3, 1.0);
  Performer person(body, ways.start[k], hanging(outward, upright));
  person.act = ways.act[k];
  person.arm_swing = draws.styled(who + "arms.swing", style, 0.55, 1.1);
  for (size_t i = 0; i < person.sway.size(); ++i)
    person.sway[i] = Sway(draws.stream(who + "sway." + std::to_string(i)));
  return person;
}

namespace {

void give_ways(Performer& person, const Timing& timing, int k, const Clock& clock) {
  person.reaction = timing.reaction[k];
  person.gait.walk(later(timing.approach[k], clock.first_step));
  for (const Walk& walk : timing.leave[k]) person.gait.walk(later(walk, clock.release_end));
}

}  // namespace

Staged set_stage(Task task, const SynthesisOptions& options, Draws& draws) {
  const Act& act = definition_of(task).act;
  const double distance = draws.uniform("distance", 2.4, 4.2, options.distance);
  const double angle = draws.uniform("angle", -30.0 * kDegree, 30.0 * kDegree, options.angle);
  const double speed = draws.uniform("speed", 0.75, 1.15, options.speed);
  const std::optional<bool> left =
      options.side ? std::optional<bool>(*options.side == Side::kLeft) : std::optional<bool>();

  Cast cast;
  cast.body = {draw_body("a.", options.height_a, draws), draw_body("b.", options.height_b, draws)};
  cast.side = draws.chance("left_handed", 0.15, left) ? 0 : 1;
  cast.style = draws.uniform("style", 0.0, 1.0, options.style);
  cast.target_height = options.target_height;
  cast.farthest = distance - kShortestWay;
  const Layout layout = act.layout(cast, draws);
  draws.record("act.distance", layout.distance);

  const Ways ways = plan_ways(layout, distance, angle, draws.uniform("a.share_of_way", 0.4, 0.6));
  Scene scene{cast,
              layout,
              {make_performer(cast.body[0], ways, 0, cast.style, draws),
               make_performer(cast.body[1], ways, 1, cast.style, draws)},
              0.0,
              0.0,
              0.0,
              {}};
  const std::array<double, 2> speeds = {speed, speed * draws.uniform("b.relative_speed", 0.9, 1.0)};
  double seconds = draw_seconds(act, options, draws);
  Timing timing = plan_timing(act, scene, ways, speeds, false, draws);
  if (timing.fixed(act) > seconds) timing = plan_timing(act, scene, ways, speeds, true, draws);
  require(!options.duration || timing.fixed(act) <= seconds,
          "synthesize: duration {} s is too short for these ways and this act; expected [{:.2f}, 60] s", seconds,
          timing.fixed(act));
  seconds = std::max(seconds, timing.fixed(act));
  const int frames = static_cast<int>(std::lround(seconds * options.rate_hz));

  const Clock clock = share_out(act, timing, seconds, draws);
  scene.act_begin = clock.act_begin;
  scene.act_end = clock.act_end;
  scene.release_end = clock.release_end;
  for (const int k : {0, 1}) give_ways(scene.people[k], timing, k, clock);
  return {.scene = std::move(scene), .frames = frames};
}

void look_away(Scene& scene) {
  for (Performer& person : scene.people) {
    if (person.gait.walks().empty()) continue;
    const Walk& last = person.gait.walks().back();
    if (last.turned_by < 1.0) person.look.to(last.begin, last.begin + 0.8, 0.0);
  }
}

}  // namespace duet::synthesis
