// duet hw holds: every cause of a hold over the twin, and whether the robot stays on its feet.
#include <fmt/format.h>

#include <algorithm>

#include "duet/core/names.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/hardware/episodes/hold_trial.h"
#include "duet/parts/robot/hw.h"
#include "duet/robots/robot_cards.h"
#include "duet/statistics/statistics.h"

namespace duet::cli {
namespace {

struct HoldsArguments {
  std::string walker = "homie", network, cause;
  int trials = 10;
  std::uint64_t seed = 1;
  HoldTrialSetup setup;
};

// The trials of one cause.
struct HoldCount {
  StopCause cause = StopCause::kNone;
  int trials = 0, held = 0, fell = 0, damped = 0, ran_again = 0;
  double tilt = 0.0, strayed = 0.0;  // largest [rad], [m]

  void add(const HoldTrial& trial) {
    ++trials;
    held += trial.held ? 1 : 0;
    fell += trial.fell ? 1 : 0;
    damped += trial.damped ? 1 : 0;
    ran_again += trial.ran_again ? 1 : 0;
    tilt = std::max(tilt, trial.tilt);
    strayed = std::max(strayed, trial.strayed);
  }
};

std::vector<StopCause> chosen_causes(const std::string& name) {
  if (name.empty()) return causes_of_holds();
  std::vector<std::string> names;
  for (const StopCause cause : causes_of_holds()) {
    names.emplace_back(stop_cause_name(cause));
    if (names.back() == name) return {cause};
  }
  throw std::invalid_argument(unknown_name_message("cause of a hold", name, names));
}

std::string row_text(const HoldCount& count) {
  return fmt::format("{:<15} {:>6} {:>5} {:>5} {:>7} {:>9} {:>9.3f} {:>11.3f}", stop_cause_name(count.cause),
                     count.trials, count.held, count.fell, count.damped, count.ran_again, count.tilt, count.strayed);
}

nlohmann::json row_json(const HoldCount& count) {
  return {{"cause", stop_cause_name(count.cause)},
          {"trials", count.trials},
          {"held", count.held},
          {"fell", count.fell},
          {"damped", count.damped},
          {"ran_again", count.ran_again},
          {"tilt", count.tilt},
          {"strayed", count.strayed}};
}

void run_holds(Session& session, const HoldsArguments& arguments) {
  const std::vector<StopCause> causes = chosen_causes(arguments.cause);
  ControllerOptions options;
  if (!arguments.network.empty()) options["network"] = arguments.network;
  const auto make_walker = Walker::load(arguments.walker, options, load_shared_robot());
  note(session,
       fmt::format("{} trials of each of {} causes: a twin with {} behind it under '{}' goes {} m/s behind its guard, "
                   "is held for {} s, and is asked to run again. Nothing but the twin is commanded.",
                   arguments.trials, causes.size(), arguments.setup.engine, arguments.walker, arguments.setup.forward,
                   arguments.setup.seconds));
  catch_interrupts();
  HoldCount all;
  nlohmann::json rows = nlohmann::json::array();
  std::string text = "cause           trials  held  fell  damped ran again tilt [rad] strayed [m]\n";
  for (const StopCause cause : causes) {
    HoldCount count{.cause = cause};
    for (int k = 0; k < arguments.trials && interrupt() == Interrupt::kNone; ++k) {
      const HoldTrial trial =
          run_hold_trial(cause, arguments.setup, make_walker(), arguments.seed + static_cast<std::uint64_t>(k));
      count.add(trial);
      all.add(trial);
      if (trial.fell || !trial.held)
        note(session,
             fmt::format("{}, trial {}: {}{}", stop_cause_name(cause), k, trial.said, trial.fell ? ", fell" : ""));
    }
    note(session, row_text(count));
    text += row_text(count) + "\n";
    rows.push_back(row_json(count));
  }
  const Interval falls = wilson(all.fell, std::max(all.trials, 1));
  print(session,
        fmt::format("{}{} of {} fell ({:.1f} % [{:.1f}, {:.1f}])", text, all.fell, all.trials,
                    all.trials > 0 ? 100.0 * all.fell / all.trials : 0.0, 100.0 * falls.low, 100.0 * falls.high),
        {{"causes", rows}, {"trials", all.trials}, {"fell", all.fell}});
  if (all.fell > 0 || all.held < all.trials) session.exit_code = kExitGate;
  if (interrupt() != Interrupt::kNone) session.exit_code = kExitInterrupted;
}

}  // namespace

void add_holds(CLI::App& hardware, Session& session) {
  const auto arguments = std::make_shared<HoldsArguments>();
  CLI::App* command =
      add_command(hardware, session, "holds", "whether a twin that is held stays on its feet, cause by cause",
                  "duet hw holds --walker wbc_sim --forward 0 --trials 3");
  command->add_option("--walker", arguments->walker, "controller that keeps it on its feet")->capture_default_str();
  command->add_option("--network", arguments->network, "of the walker");
  command->add_option("--cause", arguments->cause, "of the holds; without: each");
  command->add_option("--trials", arguments->trials, "of each cause")
      ->capture_default_str()
      ->check(CLI::Range(1, 100000));
  command->add_option("--seconds", arguments->setup.seconds, "of each hold")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 3600.0));
  command->add_option("--forward", arguments->setup.forward, "that it goes with before [m/s]")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 0.25));
  command->add_option("--noise", arguments->setup.noise, "of the twin's sensors, as a share of the usual")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 100.0));
  command->add_option("--engine", arguments->setup.engine, "behind the twin")->capture_default_str();
  command->add_option("--seed", arguments->seed, "of the first trial")->capture_default_str();
  command->callback([&session, arguments] { run_holds(session, *arguments); });
}

}  // namespace duet::cli
