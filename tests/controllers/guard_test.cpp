
#include <gmock/gmock.h>

#include <limits>

#include "duet/controllers/controller.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "tests/backends/allocation_count.h"
#include "tests/backends/g1_scene.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Commands the reference's angles plus `offset`, which a test makes broken.
class Offset final : public Controller {
 public:
  Offset(const double& offset, int& calls) : offset_(offset), calls_(calls) {}
  [[nodiscard]] std::string_view name() const override { return "offset"; }
  [[nodiscard]] int acts_per_tick() const override { return acts; }
  void reset(const RobotState&) override {}
  void act(const RobotState&, const Reference& reference, JointCommand& command) override {
    ++calls_;
    command = test::g1()->default_command(reference.q);
    command.q_target[3] += offset_;
    command.kp.setConstant(77.0);
  }

  int acts = 1;

 private:
  const double& offset_;
  int& calls_;
};

struct Guarded : ::testing::Test {
  Guarded() { controller->reset(state); }
  void act() { controller->act(state, reference, command); }

  std::shared_ptr<const RobotModel> robot = test::g1();
  double offset = 0.0;
  int calls = 0;
  std::unique_ptr<Controller> controller = make_guarded(std::make_unique<Offset>(offset, calls), robot);
  RobotState state = robot->standing_state();
  Reference reference{state.X_WB, robot->neutral};
  JointCommand command;
};

TEST_F(Guarded, PassesFiniteCommandsOnUnchanged) {
  offset = 0.25;
  act();
  EXPECT_DOUBLE_EQ(command.q_target[3], robot->neutral[3] + 0.25);
  EXPECT_EQ(command.kp[0], 77.0);
  EXPECT_EQ(controller->name(), "offset");
  EXPECT_EQ(controller->faults().observations + controller->faults().actions, 0);
}

TEST_F(Guarded, HoldsTheLastFiniteCommandForFiveTicksThenRampsDown) {
  offset = 0.25;
  act();
  state.q[3] = 0.7;
  for (const double broken : {kNan, kInfinity, -kInfinity, kNan, kNan}) {
    offset = broken;
    act();
    EXPECT_DOUBLE_EQ(command.q_target[3], robot->neutral[3] + 0.25);
    EXPECT_EQ(command.kp[0], 77.0);
    EXPECT_FALSE(controller->faults().stopped);
  }
  act();
  EXPECT_TRUE(controller->faults().stopped);
  EXPECT_EQ(controller->faults().actions, 6);
  EXPECT_DOUBLE_EQ(command.q_target[3], 0.7);
  EXPECT_DOUBLE_EQ(command.kp[0], robot->joints[0].kp);
  for (int tick = 0; tick < kGuardRampTicks; ++tick) {
    const double before = command.kp[0];
    act();
    EXPECT_LT(command.kp[0], before);
  }
  EXPECT_EQ(command.kp.norm(), 0.0);
  EXPECT_DOUBLE_EQ(command.kd[0], robot->joints[0].kd);
}

TEST_F(Guarded, HoldsAsLongAndRampsAsSlowlyWhereItActsTwiceATick) {
  auto twice = std::make_unique<Offset>(offset, calls);
  twice->acts = 2;
  controller = make_guarded(std::move(twice), robot);
  EXPECT_EQ(controller->acts_per_tick(), 2);
  controller->reset(state);
  act();
  offset = kNan;
  for (int call = 0; call < 2 * kGuardHeldTicks; ++call) act();
  EXPECT_FALSE(controller->faults().stopped);
  act();
  EXPECT_TRUE(controller->faults().stopped);
  for (int call = 1; call < 2 * kGuardRampTicks; ++call) act();
  EXPECT_GT(command.kp[0], 0.0);
  act();
  EXPECT_EQ(command.kp[0], 0.0);
}

TEST_F(Guarded, StaysStoppedUntilReset) {
  offset = kNan;
  for (int tick = 0; tick < 10; ++tick) act();
  offset = 0.0;
  const int calls_before = calls;
  act();
  EXPECT_EQ(calls, calls_before);
  EXPECT_TRUE(controller->faults().stopped);
  controller->reset(state);
  EXPECT_FALSE(controller->faults().stopped);
  EXPECT_EQ(controller->faults().actions, 0);
  act();
  EXPECT_EQ(command.kp[0], 77.0);
}

TEST_F(Guarded, KeepsBrokenStatesAndReferencesFromTheController) {
  act();
  int expected = 0;
  const auto broken = [&](double& value) {
    const double good = value;
    value = kNan;
    act();
    EXPECT_EQ(controller->faults().observations, ++expected);
    EXPECT_TRUE(command.q_target.allFinite());
    value = good;
    act();  // a good tick in between: no five in a row
  };
  const int calls_before = calls;
  broken(state.q[7]);
  broken(state.v[7]);
  broken(state.v_WB[1]);
  broken(state.w_WB_B[2]);
  broken(state.X_WB.p[0]);
  broken(state.X_WB.R.coeffs()[1]);
  broken(reference.q[5]);
  broken(reference.X_WB.p[2]);
  broken(reference.X_WB.R.coeffs()[3]);
  EXPECT_EQ(calls - calls_before, expected);
  EXPECT_FALSE(controller->faults().stopped);
}

TEST_F(Guarded, FreezesAtTheAnglesLastMeasuredWhereTheStateIsLost) {
  state.q[3] = 0.7;
  act();
  state.q[3] = kNan;
  for (int tick = 0; tick < 8; ++tick) act();
  EXPECT_TRUE(controller->faults().stopped);
  EXPECT_DOUBLE_EQ(command.q_target[3], 0.7);
}

TEST_F(Guarded, HoldsTheStartWhereNothingWasEverFinite) {
  offset = kNan;
  act();
  EXPECT_EQ(command.q_target, state.q);
  EXPECT_DOUBLE_EQ(command.kp[0], robot->joints[0].kp);
}

TEST_F(Guarded, RefusesAnotherRobotsSizes) {
  reference.q.resize(12);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { act(); }));
  state.q[0] = kNan;
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { controller->reset(state); }));
}

TEST_F(Guarded, AllocatesNothingInTheSafeStop) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: the sanitizer counts";
  act();
  state.q[0] = kNan;
  const long before = test::allocation_count();
  for (int tick = 0; tick < 40; ++tick) act();
  EXPECT_EQ(test::allocation_count(), before);
}

TEST_F(Guarded, IsRefusedWhereACommandIsNotFinite) {
  offset = kNan;
  EXPECT_SENTENCE(thrown_message<InputError>([&] { require_usable(*controller, *robot, "offset"); }));
}

// Computes for 25 ms before it answers, in its first `late` acts; throws where it is told to.
struct Late final : Controller {
  [[nodiscard]] std::string_view name() const override { return "late"; }
  void reset(const RobotState&) override {}
  void act(const RobotState&, const Reference&, JointCommand&) override {
    if (throws) throw std::runtime_error("no such gain");
    const double begin = thread_computed_seconds();
    while (calls < late && thread_computed_seconds() < begin + 0.025) continue;
    ++calls;
  }

  int calls = 0, late = 0;
  bool throws = false;
};

TEST(RequireUsable, LetsAControllerActForAFewTicks) {
  Late quick;
  EXPECT_NO_THROW(require_usable(quick, *test::g1(), "mine"));
  EXPECT_EQ(quick.calls, kTriedTicks);
}

TEST(RequireUsable, RefusesAControllerWhoseQuickestTickIsLate) {
#ifdef DUET_SANITIZED
  GTEST_SKIP() << "not run: checked code may be slower";
#endif
  Late late;
  late.late = 1000;
  EXPECT_THAT(
      thrown_message<InputError>([&] { require_usable(late, *test::g1(), "mine"); }),
      ::testing::MatchesRegex("controller 'mine': expected an answer within a tick of 20 ms, found 2[5-9][.0-9]* "
                              "ms of computing in the quickest of 5 tries: take a smaller network, or one that "
                              "acts less often in a tick"));
  EXPECT_EQ(late.calls, kTriedTicks);
}

TEST(RequireUsable, OneAnswerOnTimeWillDo) {
  Late late;
  late.late = kTriedTicks - 1;
  EXPECT_NO_THROW(require_usable(late, *test::g1(), "mine"));
}

TEST(RequireUsable, LeavesWhatThrowsToTheEpisode) {
  Late late;
  late.throws = true;
  EXPECT_NO_THROW(require_usable(late, *test::g1(), "mine"));
}

}  // namespace
}  // namespace duet
