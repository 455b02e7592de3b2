#include "duet/execution/stepped_episodes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <new>
#include <utility>

#include "duet/backends/engine_module.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/work/run_work.h"
#include "duet/policies/language.h"

namespace duet {
namespace {

constexpr double kWhile = 1.0;  // [s] between two looks at whether the episode is over

// `asked`, or the first of `known` where none is.
std::string one_of(const char* kind, const std::string& asked, const std::vector<std::string>& known) {
  if (asked.empty() && !known.empty()) return known.front();
  if (std::ranges::find(known, asked) == known.end())
    throw std::invalid_argument(unknown_name_message(kind, asked, known));
  return asked;
}

std::string engine_of(const Suite& suite, const std::string& asked) {
  if (!asked.empty()) return one_of("engine", asked, suite.engines);
  const auto runs = [](const std::string& name) { return name != kPlaybackEngine && can_run_in(name); };
  const auto found = std::ranges::find_if(suite.engines, runs);
  return found == suite.engines.end() ? suite.engines.front() : *found;
}

// The suite of one policy, the caller, in one engine under one controller.
Suite narrowed(Suite suite, const SteppedPart& part) {
  suite.require_clips();
  if (!suite.references.empty())
    throw InputError(fmt::format("{}: expected a suite of clips, found one of walking commands", suite.file));
  suite.engines = {engine_of(suite, part.engine)};
  suite.controllers = {suite.controller(one_of("controller", part.controller, suite.controller_names()))};
  suite.perturbations = {suite.perturbation(one_of("perturbation", part.perturbation, suite.perturbation_names()))};
  if (!part.task.empty()) suite.tasks = {parse_task(part.task)};
  suite.policies = {SuitePolicy{.name = kCaller, .use = kNullPolicy}};  // one is loaded; each episode has its own
  suite.null_arm = false;
  suite.record = RecordTrajectories::kNone;
  return suite;
}

}  // namespace

std::shared_ptr<Experiment> stepped_experiment(Suite suite, const SteppedPart& part, int threads, Progress& progress) {
  suite = narrowed(std::move(suite), part);
  if (suite.engines.front() != kPlaybackEngine) static_cast<void>(engine_module(suite.engines.front()));
  auto experiment = std::make_shared<Experiment>(std::move(suite), ExperimentOptions{.led = {kCaller}});
  if (const auto& absent = experiment->bodies().absent(); !absent.empty()) throw MissingError(absent.begin()->second);
  experiment->prepare(threads, progress);
  return experiment;
}

int questions_of(const Experiment& experiment, std::int64_t episode) {
  const int ticks = episode_ticks(experiment.setup(experiment.at(episode)));
  return (ticks + kTicksPerPlan - 1) / kTicksPerPlan;
}

// In a forked child the thread is not there to be waited for, and its queue may be locked for ever: they are left.
SteppedEpisode::~SteppedEpisode() {
  if (process_ == ::getpid()) {
    stop();
    return;
  }
  if (thread_.joinable()) thread_.detach();
  static_cast<void>(new (std::nothrow) std::shared_ptr<PlanQueue>(std::move(queue_)));
}

void SteppedEpisode::require_same_process() const {
  if (process_ == ::getpid()) return;
  throw std::runtime_error(
      fmt::format("the episode runs in process {}, and this is process {}, forked from it: expected episodes that this "
                  "process has made",
                  process_, ::getpid()));
}

void SteppedEpisode::start(int episode) {
  require_same_process();
  require(episode >= 0 && episode < experiment_->size(), "episode: expected a number from 0 to {}, found {}",
          experiment_->size() - 1, episode);
  stop();
  stop_ = false;
  row_.reset();
  queue_ = PlanQueue::make({.name = kCaller, .patience = 0.0, .share = 1.0});
  partner_ = led_ == DrivenBodies::kBoth ? std::make_shared<PointTracks>() : nullptr;
  const EpisodeOverrides overrides{.policy = queue_->maker(experiment_->at(episode).body->robot),
                                   .stop_asked = [this] { return stop_.load(); },
                                   .partner = partner_};
  thread_ = std::thread([this, episode, overrides, queue = queue_] {
    try {
      row_ = experiment_->run(episode, overrides);
    } catch (const EpisodeInterrupted&) {  // it leaves no row
    } catch (const std::exception& error) {
      const bool memory = dynamic_cast<const std::bad_alloc*>(&error) != nullptr;
      row_ = ended_row({}, Outcome::kError, memory ? "there is not enough memory for the episode" : error.what());
    }
    queue->close("the episode is over");
  });
}

PointTracks SteppedEpisode::partner_ahead() const {
  require(question_ != nullptr && partner_ != nullptr, "partner: expected an episode under way in which both are led");
  PointTracks ahead(kTicksPerPlan, kSmplJoints);
  for (int i = 0; i < kTicksPerPlan; ++i)
    ahead.frame(i) = partner_->frame(std::min(question_->tick + 1 + i, partner_->frames() - 1));
  return ahead;
}

void SteppedEpisode::lead_partner(const PointTracks& ahead) {
  require(question_ != nullptr && partner_ != nullptr, "partner: expected an episode under way in which both are led");
  require(ahead.frames() == kTicksPerPlan && ahead.points() == kSmplJoints,
          "partner: expected {} frames of {} joints, found {} of {}", kTicksPerPlan, kSmplJoints, ahead.frames(),
          ahead.points());
  require(std::ranges::all_of(ahead.data(), [](double value) { return std::isfinite(value); }),
          "partner: expected finite numbers");
  for (int i = 0; i < kTicksPerPlan && question_->tick + 1 + i < partner_->frames(); ++i)
    partner_->frame(question_->tick + 1 + i) = ahead.frame(i);
}

void SteppedEpisode::answer(std::span<const double> numbers, int rows) {
  require_same_process();
  require(question_ != nullptr, "the episode is over: begin another one");
  queue_->answer(*question_, numbers, rows);
}

std::shared_ptr<const PlanRequest> SteppedEpisode::next() {
  require_same_process();
  require(queue_ != nullptr, "the episode has not begun: begin one");
  question_.reset();
  std::vector<std::shared_ptr<const PlanRequest>> taken;
  while (taken.empty() && !queue_->closed()) taken = queue_->take(kWhile);
  if (!taken.empty()) question_ = taken.front();
  if (taken.empty()) thread_.join();
  return question_;
}

void SteppedEpisode::stop() {
  if (process_ != ::getpid()) return;  // nothing of it runs here
  stop_ = true;
  if (queue_) queue_->close("the episode was stopped");
  if (thread_.joinable()) thread_.join();
  question_.reset();
  row_.reset();
}

}  // namespace duet
