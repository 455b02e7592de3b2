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

ApproachPaths plan_ways(const Layout& layout, double distance, double angle, double share) {
  ApproachPaths ways;
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

Timing plan_timing(const Act& act, const Scene& scene, const ApproachPaths& ways, std::array<double, 2> speed,
                   bool brief, Draws& draws) {
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

Performer make_performer(const Body& body, const ApproachPaths& ways, int k, double style, Draws& draws) {
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

PlannedScene set_stage(Task task, const SynthesisOptions& options, Draws& draws) {
  const Act& act = definition_of(task).act;
  const double distance = draws.uniform("distance", 2.4, 4.2, options.distance);
  const double angle = draws.uniform("angle", -30.0 * kDegree, 30.0 * kDegree, options.angle);
  const double speed = draws.uniform("speed", 0.75, 1.15, options.speed);
  const std::optional<bool> left =
      options.side ? std::optional<bool>(*options.side == Side::kLeft) : std::optional<bool>();

  Participants cast;
  cast.body = {draw_body("a.", options.height_a, draws), draw_body("b.", options.height_b, draws)};
  cast.side = draws.chance("left_handed", 0.15, left) ? 0 : 1;
  cast.style = draws.uniform("style", 0.0, 1.0, options.style);
  cast.target_height = options.target_height;
  cast.farthest = distance - kShortestWay;
  const Layout layout = act.layout(cast, draws);
  draws.record("act.distance", layout.distance);

  const ApproachPaths ways = plan_ways(layout, distance, angle, draws.uniform("a.share_of_way", 0.4, 0.6));
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

namespace {

// Chosen, not measured: SBU's recordings are of acts that were asked for and done. The three of its 18 handshakes in
// which no hands meet are what there is to say of acts that come to nothing.
constexpr double kHesitantShare = 0.10, kAbortedShare = 0.08;
constexpr double kMostReaction = 0.6;      // of the planned motion: the acts leave no more [s]
constexpr double kQuickestWalk = 0.55;     // two steps, however short [s]
constexpr double kShortestStep = 0.05;     // less is no walk [m]
constexpr double kShortestContact = 0.04;  // [s]
constexpr double kBegin = 30.0;            // of the scene's time, so that nothing lies before 0 [s]
// Kinect's arms end before SMPL's; its people are students (docs/synthesis.md).
constexpr double kShortestArms = 0.90, kLongestArms = 1.02;

Hold half_way() { return from_shoulder({0.55, -0.02, -0.35}, {-0.4, 0.45, -1.0}, 0.05); }

bool stretches_arms(Task task) { return task != Task::kBend; }

Participants draw_cast(Task task, const SynthesisOptions& options, Draws& draws) {
  const RecordedManner& recorded = manner_of(task, options.like);
  const std::optional<bool> left =
      options.side ? std::optional<bool>(*options.side == Side::kLeft) : std::optional<bool>();
  const auto height = [&](const char* who, std::optional<double> given) -> std::optional<double> {
    if (given || recorded.height.middle == 0.0) return given;
    return std::clamp(draws.spread(who, recorded.height), 1.5, 1.95);
  };
  Participants cast;
  cast.body = {draw_body("a.", height("a.stature", options.height_a), draws, kShortestArms, kLongestArms),
               draw_body("b.", height("b.stature", options.height_b), draws, kShortestArms, kLongestArms)};
  cast.side = draws.chance("left_handed", recorded.left, left) ? 0 : 1;
  cast.style = draws.uniform("style", 0.0, 1.0, options.style);
  cast.target_height = options.target_height;
  cast.manner.rehearsed = false;
  cast.manner.tempo = draws.spread("tempo", recorded.tempo);
  if (recorded.distance.middle > 0.0) cast.manner.distance = draws.spread("act.apart", recorded.distance);
  if (recorded.contact.middle > 0.0)
    cast.manner.contact = cast.manner.tempo * std::max(kShortestContact, draws.spread("contact", recorded.contact));
  for (const int k : {0, 1}) {
    const std::string who(kWho[k]);
    if (recorded.turn.middle > 0.0) cast.manner.turn[k] = draws.spread(who + "turn", recorded.turn);
    cast.manner.bearing[k] = draws.spread(who + "bearing", recorded.bearing) - cast.manner.turn[k];
  }
  return cast;
}

// How long the act is, at tempo 1. [s]
double draw_act(const Act& act, const RecordedManner& recorded, const MotionStyle& manner, Draws& draws) {
  const double tempo = manner.tempo;
  if (recorded.touch.middle > 0.0)
    return recorded.until_touch + tempo * std::max(0.05, draws.spread("touch", recorded.touch));
  if (recorded.act.middle > 0.0) return draws.spread("act", recorded.act);
  return draws.uniform("act", act.shortest, 0.6 * act.shortest + 0.4 * act.longest) + manner.contact.value_or(0.0);
}

// The four ends of the two ways, the middle between the two in the act at the origin: each comes straight to its place,
// from where it has turned by half of `angle`.
ApproachPaths people_ways(const Layout& layout, double way, double angle, double share) {
  ApproachPaths ways;
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
void crop(const RecordedManner& recorded, const SynthesisOptions& options, double last, PlannedScene& staged,
          Draws& draws) {
  const Scene& scene = staged.scene;
  const double tempo = scene.cast.manner.tempo;
  const double touch = scene.act_begin + recorded.until_touch;
  const double before = draws.spread("before", recorded.before), after = draws.spread("after", recorded.after);
  // All that moves before the act: hands open for a hug, or hesitate, up to three seconds ahead of it.
  const double first = std::min(kBegin, scene.act_begin - 3.0 - tempo);
  staged.showing.tempo = tempo;
  const std::optional<double> stands = options.wait ? draws.memoryless("wait", *options.wait) : options.before;
  staged.showing.first = stands ? first - tempo * *stands : touch - tempo * std::max(0.1, before);
  const double end = options.after ? last + tempo * *options.after : scene.act_end + tempo * std::max(0.05, after);
  staged.frames = std::max(5, static_cast<int>(std::lround((end - staged.showing.first) / tempo * options.rate_hz)));
}

}  // namespace

PlannedScene set_people_stage(Task task, const SynthesisOptions& options, Draws& draws, ActOutcome& outcome) {
  const Act& act = definition_of(task).act;
  const RecordedManner& recorded = manner_of(task, options.like);
  const bool still = recorded.still > 0.0 && draws.chance("still", recorded.still, options.still);
  Participants cast = draw_cast(task, options, draws);
  const double tempo = cast.manner.tempo;
  const Layout layout = act.layout(cast, draws);
  const double roots = std::hypot(layout.distance, layout.lateral);
  draws.record("act.distance", roots);
  const double drawn_way = std::max(0.0, draws.spread("way", recorded.way));
  const double way = options.distance ? std::max(0.0, *options.distance - roots) : drawn_way;
  const double angle = draws.uniform("angle", -0.15, 0.15, options.angle);
  ApproachPaths ways = people_ways(layout, way, angle, still ? 1.0 : draw_share(recorded.stands, draws));
  for (const int k : {0, 1})
    if ((ways.act[k].position - ways.start[k].position).norm() < kShortestStep) ways.start[k] = ways.act[k];

  PlannedScene staged{.scene = Scene{cast,
                                     layout,
                                     {make_performer(cast.body[0], ways, 0, cast.style, draws),
                                      make_performer(cast.body[1], ways, 1, cast.style, draws)},
                                     0.0,
                                     0.0,
                                     0.0,
                                     {}},
                      .still = still};
  Scene& scene = staged.scene;
  const double speed = options.speed.value_or(std::max(0.3, draws.spread("speed", recorded.speed)));
  const double later = draws.uniform("b.starts_later", 0.0, 0.3) * tempo;
  double arrive = kBegin;
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    person.meets_skin = true;
    person.reaction =
        k == 0 ? 0.0 : std::clamp(draws.spread("b.reaction", recorded.reaction) * tempo, 0.0, kMostReaction);
    if (recorded.aside.high > 0.0) person.aside = draws.spread(std::string(kWho[k]) + "aside", recorded.aside);
    if (recorded.stoop.high > 0.0) person.stoop = draws.spread(std::string(kWho[k]) + "stoop", recorded.stoop);
    give_walk(person, ways.act[k], speed, tempo, kBegin + k * later);
    arrive = std::max(arrive, walked_until(person));
  }
  scene.act_begin = arrive - std::max(0.0, draws.spread("overlap", recorded.overlap)) * tempo;
  if (recorded.pause > 0.0) scene.act_begin += draws.memoryless("pause", recorded.pause) * tempo;
  // An embrace closes when B's arms do.
  scene.act_end =
      scene.act_begin + draw_act(act, recorded, cast.manner, draws) + (act.close ? scene.people[1].reaction : 0.0);
  scene.release_end = scene.act_end + act.release;
  double last = scene.release_end;
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    if (k == 1 && still) break;
    give_leave(person, std::max(scene.act_end + 0.1 * tempo, walked_until(person)), speed, tempo, std::string(kWho[k]),
               draws);
    last = std::max(last, walked_until(person));
  }
  outcome = draw_outcome(options, draws);
  if (outcome == ActOutcome::kHesitant) hesitate(task, scene, draws);
  crop(recorded, options, last, staged, draws);
  return staged;
}

const RecordedManner& manner_of(Task task, Likeness like) {
  const Act& act = definition_of(task).act;
  return like == Likeness::kVaried ? act.varied : act.recorded;
}

void use_both_hands(const RecordedManner& manner, Scene& scene, Draws& draws) {
  if (manner.both_hands == 0.0) return;
  const int side = scene.cast.side;
  for (const int k : {0, 1}) {
    std::array<ArmTrack, 2>& arms = scene.people[k].arms;
    if (draws.chance(std::string(kWho[k]) + "both_hands", manner.both_hands)) arms[1 - side] = arms[side];
  }
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
