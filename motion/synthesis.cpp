#include "duet/motion/synthesis.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "duet/core/require.h"
#include "duet/motion/synthesis/render.h"
#include "duet/motion/synthesis/stage.h"
#include "duet/tasks/task_definition.h"

namespace duet {
namespace {

using synthesis::Act;
using synthesis::Draws;
using synthesis::Scene;
using synthesis::Staged;

void check(const char* name, std::optional<double> value, double low, double high, const char* unit) {
  if (!value) return;
  require(*value >= low && *value <= high,
          fmt::format("synthesize: {} {}{} is out of range; expected [{:.6g}, {:.6g}]{}", name, *value, unit, low, high,
                      unit));
}

}  // namespace

void check_synthesis_options(Task task, const SynthesisOptions& options) {
  const Act& act = definition_of(task).act;
  require(options.index >= 0, fmt::format("synthesize: index {} is out of range; expected 0 or more", options.index));
  check("height_a", options.height_a, 1.5, 1.95, " m");
  check("height_b", options.height_b, 1.5, 1.95, " m");
  check("distance", options.distance, 2.0, 5.0, " m");
  check("angle", options.angle, -std::numbers::pi / 3.0, std::numbers::pi / 3.0, " rad");
  check("speed", options.speed, 0.6, 1.2, " m/s");
  check("style", options.style, 0.0, 1.0, "");
  check("duration", options.duration, 10.0, 60.0, " s");
  check("rate_hz", options.rate_hz, 20.0, 240.0, " Hz");
  if (options.target_height)
    require(act.lowest < act.highest, fmt::format("synthesize: {} has no target_height; expected none, found {} m",
                                                  to_string(task), *options.target_height));
  check("target_height", options.target_height, act.lowest, act.highest, " m");
}

namespace {

std::vector<ContactWindow> windows(const Scene& scene, double rate_hz) {
  std::vector<ContactWindow> found;
  for (const synthesis::Touch& touch : scene.touches)
    found.push_back({static_cast<int>(std::ceil(touch.begin * rate_hz)),
                     static_cast<int>(std::floor(touch.end * rate_hz)) + 1, touch.joint_a, touch.joint_b});
  return found;
}

}  // namespace

InteractionClip synthesize(Task task, const SynthesisOptions& options) {
  check_synthesis_options(task, options);
  const Act& act = definition_of(task).act;
  Draws draws(options.seed, task, options.index);
  Staged staged = set_stage(task, options, draws);
  act.perform(staged.scene, draws);
  synthesis::look_away(staged.scene);

  InteractionClip clip;
  clip.id = fmt::format("synth-{}-s{}-{:04}", to_string(task), options.seed, options.index);
  clip.task = task;
  std::array<HumanMotion, 2> motions = render(staged.scene.people, staged.frames, options.rate_hz);
  clip.a = std::move(motions[0]);
  clip.b = std::move(motions[1]);
  clip.phases = {static_cast<int>(std::lround(staged.scene.act_begin * options.rate_hz)),
                 static_cast<int>(std::lround(staged.scene.act_end * options.rate_hz))};
  clip.contacts = windows(staged.scene, options.rate_hz);
  clip.source = draws.recorded();
  clip.source["generator"] = "synthesis";
  clip.source["seed"] = std::to_string(options.seed);
  clip.source["index"] = std::to_string(options.index);
  clip.source["side"] = staged.scene.cast.side == 0 ? "left" : "right";
  return clip;
}

}  // namespace duet
