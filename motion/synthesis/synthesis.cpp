#include "duet/motion/synthesis/synthesis.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/motion/synthesis/stage.h"
#include "duet/tasks/task_definition.h"

namespace duet {
namespace {

using synthesis::Act;
using synthesis::Draws;
using synthesis::PlannedScene;
using synthesis::Scene;

constexpr const char* kGenerator = "generator";  // of a clip's source
constexpr const char* kSynthesis = "synthesis";

void check(const char* name, std::optional<double> value, double low, double high, const char* unit) {
  if (!value) return;
  require(*value >= low && *value <= high, "synthesize: {} {}{} is out of range; expected [{:.6g}, {:.6g}]{}", name,
          *value, unit, low, high, unit);
}

}  // namespace

void check_synthesis_options(Task task, const SynthesisOptions& options) {
  const Act& act = definition_of(task).act;
  require(options.index >= 0, "synthesize: index {} is out of range; expected 0 or more", options.index);
  check("height_a", options.height_a, 1.5, 1.95, " m");
  check("height_b", options.height_b, 1.5, 1.95, " m");
  const bool people = options.like != Likeness::kScripted, varied = options.like == Likeness::kVaried;
  check("distance", options.distance, people ? 0.3 : 2.0, 5.0, " m");
  check("angle", options.angle, -std::numbers::pi / 3.0, std::numbers::pi / 3.0, " rad");
  check("speed", options.speed, people ? 0.3 : 0.6, 1.2, " m/s");
  check("style", options.style, 0.0, 1.0, "");
  check("duration", options.duration, 10.0, 60.0, " s");
  check("rate_hz", options.rate_hz, 20.0, 240.0, " Hz");
  check("before", options.before, 0.0, 30.0, " s");
  check("after", options.after, 0.0, 30.0, " s");
  check("wait", options.wait, 0.0, 30.0, " s");
  require(!people || !options.duration,
          "synthesize: clips like people have no duration; expected before and after, which say what is shown");
  require(people || (!options.before && !options.after && !options.outcome),
          "synthesize: before, after and outcome are of clips like people; expected like=people or like=varied");
  require(varied || (!options.wait && !options.still),
          "synthesize: wait and still are of clips that vary; expected like=varied");
  require(!options.wait || !options.before, "synthesize: wait draws what before gives; expected one of them");
  require(!options.still || act.varied.still > 0.0,
          "synthesize: {} needs both people; expected no value of still, found {}", to_string(task),
          options.still.value_or(false));
  if (options.target_height)
    require(act.lowest < act.highest, "synthesize: {} has no target_height; expected none, found {} m", to_string(task),
            *options.target_height);
  check("target_height", options.target_height, act.lowest, act.highest, " m");
}

namespace {

// The contact windows that the clip shows, as far as it does.
std::vector<ContactWindow> windows(const PlannedScene& staged, double rate_hz) {
  const auto index = [&](double t) { return (t - staged.showing.first) / staged.showing.tempo * rate_hz; };
  std::vector<ContactWindow> found;
  for (const synthesis::Touch& touch : staged.scene.touches) {
    const int begin = std::max(0, static_cast<int>(std::ceil(index(touch.begin))));
    const int end = std::min(staged.frames, static_cast<int>(std::floor(index(touch.end))) + 1);
    if (begin < end) found.push_back({begin, end, touch.joint_a, touch.joint_b});
  }
  return found;
}

Phases phases_of(const PlannedScene& staged, double rate_hz) {
  const auto frame = [&](double t) {
    return static_cast<int>(std::lround((t - staged.showing.first) / staged.showing.tempo * rate_hz));
  };
  const int begin = std::clamp(frame(staged.scene.act_begin), 0, staged.frames - 1);
  return {begin, std::clamp(frame(staged.scene.act_end), begin + 1, staged.frames)};
}

}  // namespace

namespace {

// The side and angle that are asked for, as they are before the clip is turned into its mirror image.
SynthesisOptions before_mirror(SynthesisOptions options) {
  if (options.side) options.side = *options.side == Side::kLeft ? Side::kRight : Side::kLeft;
  if (options.angle) options.angle = -*options.angle;
  return options;
}

void perform(const Act& act, const synthesis::RecordedManner& manner, ActOutcome outcome, PlannedScene& staged,
             Draws& draws) {
  const synthesis::Performer partner = staged.scene.people[1];
  if (outcome == ActOutcome::kAborted) {
    perform_abort(staged.scene, draws);
  } else {
    act.perform(staged.scene, draws);
    use_both_hands(manner, staged.scene, draws);
  }
  if (staged.still) staged.scene.people[1] = partner;
  synthesis::look_away(staged.scene);
}

}  // namespace

InteractionClip synthesize(Task task, const SynthesisOptions& given) {
  check_synthesis_options(task, given);
  const bool people = given.like != Likeness::kScripted;
  const synthesis::RecordedManner manner =
      people ? synthesis::manner_of(task, given.like) : synthesis::RecordedManner{};
  Draws draws(given.seed, task, given.index, manner.breadth);
  const bool mirror = manner.mirrored > 0.0 && draws.chance("mirrored", manner.mirrored);
  const SynthesisOptions options = mirror ? before_mirror(given) : given;
  ActOutcome outcome = ActOutcome::kComplete;
  PlannedScene staged = people ? set_people_stage(task, options, draws, outcome) : set_stage(task, options, draws);
  perform(definition_of(task).act, manner, outcome, staged, draws);

  InteractionClip clip;
  clip.id = synthetic_clip_id(synthetic_manner(options.like), to_string(task), options.seed, options.index);
  clip.task = task;
  std::array<HumanMotion, 2> motions = render(staged.scene.people, staged.frames, options.rate_hz, staged.showing);
  clip.a = std::move(motions[0]);
  clip.b = std::move(motions[1]);
  clip.phases = phases_of(staged, options.rate_hz);
  clip.contacts = windows(staged, options.rate_hz);
  clip.source = draws.recorded();
  clip.source[kGenerator] = kSynthesis;
  clip.source["seed"] = std::to_string(options.seed);
  clip.source["index"] = std::to_string(options.index);
  if (people) {
    clip.source["like"] = kLikenessNames.at(static_cast<std::size_t>(options.like));
    clip.source["outcome"] = kActOutcomeNames.at(static_cast<std::size_t>(outcome));
  }
  // The one who has the initiative is the robot's where nobody else acts.
  if (staged.still) clip.reactor = Person::kA;
  clip.source["side"] = (staged.scene.cast.side == 0) != mirror ? "left" : "right";
  return mirror ? mirrored(clip) : clip;
}

std::string_view synthetic_manner(Likeness like) {
  return like == Likeness::kScripted ? "synth" : kLikenessNames.at(static_cast<std::size_t>(like));
}

bool is_synthesised(const std::map<std::string, std::string>& source) {
  const auto generator = source.find(kGenerator);
  return generator != source.end() && generator->second == kSynthesis;
}

}  // namespace duet
