// A standing robot beside its card: a load and a lean that were put there are found, through noisy sensors.
#include "duet/hardware/guard/identification.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "duet/hardware/twin/lock_step.h"
#include "duet/robots/dynamics.h"
#include "tests/backends/engine_names.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kStands = 9.0;    // of the twin's time, off its rope [s]
constexpr double kSeconds = 10.0;  // of standing

std::shared_ptr<const RobotModel> loaded(double kg) {
  auto robot = std::make_shared<RobotModel>(*test::g1());
  robot->links[robot->frames[robot->roles.push_frame].link].mass += kg;
  return robot;
}

// A twin that stands under WBC-Sim behind its guard, `kg` heavier at its trunk, whose IMU leans by `roll`, with the
// noise of sensors and a newton metre on each torque.
StandingFindings findings_of(double kg, double roll, std::uint64_t seed, double seconds = kSeconds) {
  GuardSetup setup = test::twin_guard();
  setup.limiter.robot = loaded(kg);
  TwinInProcess link(setup, noisy_twin(1.0, "mujoco", seed),
                     std::make_unique<Walker>("wbc_sim", ControllerOptions{}, test::g1()), nullptr,
                     {{TwinFaultKind::kTilt, 0.0, 100.0, roll}});
  Random random(seed, 21);
  link.trouble.spoil = [&random](LowStateFrame& frame) {
    for (int j = 0; j < kG1Motors; ++j) frame.motor[j].tau_est += static_cast<float>(random.normal());
  };
  PlannerMessage plan;
  plan.command.q = test::g1()->neutral;
  plan.command.root.height = HardwareLimits{}.height;
  StandingIdentification standing(test::g1());
  GuardReport report;
  while (link.twin().time() < kStands + seconds) {
    ++plan.sequence;
    plan.command.stamp = link.twin().time();
    link.send(plan);
    link.next(report);
    if (link.twin().time() > kStands) standing.see(link.guard().reading());
  }
  EXPECT_EQ(link.twin().physics()->hanging(), 0.0);
  return standing.findings();
}

TEST(Identification, ALoadAndALeanAreFoundWithinATenth) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  constexpr double kLoad = 3.0, kLean = 2.0;
  constexpr int kSeeds = 20;
  double load = 0.0, lean = 0.0, worst_load = 0.0, worst_lean = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const StandingFindings with = findings_of(kLoad, kLean * kDegree, static_cast<std::uint64_t>(seed));
    const double kg = with.mass - with.card_mass, degrees = with.lean.norm() / kDegree;
    load += kg / kSeeds;
    lean += degrees / kSeeds;
    worst_load = std::max(worst_load, std::abs(kg - kLoad));
    worst_lean = std::max(worst_lean, std::abs(degrees - kLean));
  }
  fmt::print(
      "identification: of 3 kg {:.2f} kg (at most {:.2f} off), of 2 degrees {:.2f} (at most {:.2f} off), {} seeds\n",
      load, worst_load, lean, worst_lean, kSeeds);
  EXPECT_LT(worst_load, 0.1 * kLoad);
  EXPECT_LT(worst_lean, 0.1 * kLean);
}

TEST(Identification, ARobotLikeItsCardHasNeither) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const StandingFindings found = findings_of(0.0, 0.0, 7);
  EXPECT_NEAR(found.mass, found.card_mass, 0.3);
  EXPECT_LT(found.lean.norm(), 0.2 * kDegree);
  EXPECT_LT(found.com.norm(), 0.01);
  EXPECT_LT(found.soles_apart, 0.5 * kDegree);
  const std::string text = findings_text(found, *test::g1());
  EXPECT_NE(text.find("not to be told apart"), std::string::npos);
  EXPECT_NEAR(findings_json(found, *test::g1())["mass"].get<double>(), found.mass, 1e-12);
}

TEST(Identification, ALimpRobotIsNoneThatStands) {
  RobotReading reading;
  reading.state = test::g1()->standing_state();
  StandingIdentification standing(test::g1());
  reading.tau.setZero(kG1Motors);
  for (int k = 0; k < 600; ++k) standing.see(reading);
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { (void)standing.findings(); }));
}

TEST(Identification, RefusesWhatDoesNotStand) {
  RobotReading reading;
  reading.state = test::g1()->standing_state();
  StandingIdentification few(test::g1()), moving(test::g1());
  for (int k = 0; k < 100; ++k) few.see(reading);
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { (void)few.findings(); }));
  for (int k = 0; k < 600; ++k) {
    reading.state.q[3] += 0.001;
    moving.see(reading);
  }
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { (void)moving.findings(); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { StandingIdentification none(nullptr); }));
}

}  // namespace
}  // namespace duet
