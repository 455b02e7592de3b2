// duet hw walks: random places and headings over the twin, and how near to them the robot comes to rest.
#include <fmt/format.h>

#include <algorithm>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/hardware/episodes/walk_trial.h"
#include "duet/parts/robot/hw.h"
#include "duet/robots/robot_cards.h"
#include "duet/statistics/statistics.h"

namespace duet::cli {
namespace {

struct WalksArguments {
  std::string walker = "homie", network;
  int trials = 20;
  double nearest = 0.2, furthest = 1.5;
  std::uint64_t seed = 1;
  WalkTrialSetup setup;
};

// The trials of a command.
struct WalkCount {
  int trials = 0, reached = 0, beyond = 0, held = 0, fell = 0, restless = 0;
  double off = 0.0, turned_off = 0.0, past = -kNoLimit, seconds = 0.0;  // sums, the largest way past the goal, a sum

  void add(const WalkTrial& trial) {
    ++trials;
    reached += trial.reached() ? 1 : 0;
    beyond += trial.beyond > 0.0 ? 1 : 0;
    held += trial.held ? 1 : 0;
    fell += trial.fell ? 1 : 0;
    restless += trial.stands || trial.held || trial.fell ? 0 : 1;
    off += trial.off;
    turned_off += trial.turned_off;
    past = std::max(past, trial.beyond);
    seconds += trial.seconds;
  }
};

std::string trial_text(int index, const WalkGoal& goal, const WalkTrial& trial) {
  return fmt::format(
      "{:3d} {:.2f} m to {:+.2f} rad, turned {:+.2f} rad: {:.3f} m and {:.3f} rad off, {:+.3f} m past it, "
      "{:.1f} s{}{}{}",
      index, goal.distance, goal.direction, goal.heading, trial.off, trial.turned_off, trial.beyond, trial.seconds,
      trial.reached() ? "" : ", not reached", trial.fell ? ", fell" : "", trial.said.empty() ? "" : ": " + trial.said);
}

nlohmann::json trial_json(const WalkGoal& goal, const WalkTrial& trial) {
  return {{"distance", goal.distance},
          {"direction", goal.direction},
          {"heading", goal.heading},
          {"off", trial.off},
          {"turned_off", trial.turned_off},
          {"beyond", trial.beyond},
          {"seconds", trial.seconds},
          {"reached", trial.reached()},
          {"held", trial.held},
          {"fell", trial.fell},
          {"said", trial.said}};
}

std::string count_text(const WalkCount& count) {
  const int n = std::max(count.trials, 1);
  const Interval share = wilson(count.reached, n);
  return fmt::format(
      "{} of {} reached within {} m and {} rad ({:.1f} % [{:.1f}, {:.1f}]); {} went past the place, by {:+.3f} m at "
      "most; the guard ended {}, {} fell, {} did not come to rest; {:.3f} m and {:.3f} rad off and {:.1f} s on average",
      count.reached, count.trials, kReachedPlace, kReachedHeading, 100.0 * count.reached / n, 100.0 * share.low,
      100.0 * share.high, count.beyond, count.past, count.held, count.fell, count.restless, count.off / n,
      count.turned_off / n, count.seconds / n);
}

void run_walks(Session& session, const WalksArguments& arguments) {
  require(arguments.nearest <= arguments.furthest, "--nearest: expected at most --furthest ({} m), found {} m",
          arguments.furthest, arguments.nearest);
  ControllerOptions options;
  if (!arguments.network.empty()) options["network"] = arguments.network;
  const auto make_walker = Walker::load(arguments.walker, options, load_shared_robot());
  note(session,
       fmt::format("{} places {} to {} m away in any direction, with any heading: a twin with {} behind it walks there "
                   "under '{}', behind its guard, from seed {} on. Nothing but the twin is commanded.",
                   arguments.trials, arguments.nearest, arguments.furthest, arguments.setup.engine, arguments.walker,
                   arguments.seed));
  catch_interrupts();
  WalkCount count;
  nlohmann::json rows = nlohmann::json::array();
  for (int k = 0; k < arguments.trials && interrupt() == Interrupt::kNone; ++k) {
    const std::uint64_t seed = arguments.seed + static_cast<std::uint64_t>(k);
    const WalkGoal goal = random_goal(arguments.nearest, arguments.furthest, seed);
    const WalkTrial trial = run_walk_trial(goal, arguments.setup, make_walker(), seed);
    count.add(trial);
    rows.push_back(trial_json(goal, trial));
    note(session, trial_text(k, goal, trial));
  }
  print(session, count_text(count),
        {{"trials", count.trials},
         {"reached", count.reached},
         {"beyond", count.beyond},
         {"held", count.held},
         {"fell", count.fell},
         {"goals", rows}});
  if (count.reached < count.trials) session.exit_code = kExitGate;
  if (interrupt() != Interrupt::kNone) session.exit_code = kExitInterrupted;
}

}  // namespace

void add_walks(CLI::App& hardware, Session& session) {
  const auto arguments = std::make_shared<WalksArguments>();
  CLI::App* command = add_command(hardware, session, "walks", "how near to random places a twin comes to rest",
                                  "duet hw walks --trials 20 --seed 90000");
  command->add_option("--walker", arguments->walker, "controller that keeps it on its feet")->capture_default_str();
  command->add_option("--network", arguments->network, "of the walker");
  command->add_option("--trials", arguments->trials, "places")->capture_default_str()->check(CLI::Range(1, 100000));
  command->add_option("--nearest", arguments->nearest, "place [m]")->capture_default_str()->check(CLI::Range(0.0, 3.0));
  command->add_option("--furthest", arguments->furthest, "place [m]")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 3.0));
  command->add_option("--noise", arguments->setup.noise, "of the twin's sensors, as a share of the usual")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 100.0));
  command->add_option("--engine", arguments->setup.engine, "behind the twin")->capture_default_str();
  command->add_option("--seed", arguments->seed, "of the first place, and of the noise on its way")
      ->capture_default_str();
  command->callback([&session, arguments] { run_walks(session, *arguments); });
}

}  // namespace duet::cli
