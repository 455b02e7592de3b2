// Policies in processes of their own: tiny Python programs, most of which misbehave.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "duet/core/require.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/external/external_policy.h"
#include "duet/policies/external/process_policy.h"
#include "duet/robots/kinematics.h"
#include "tests/policies/process_fixtures.h"

namespace duet {
namespace {

using test::g1;
using test::polite;
using test::ProcessPolicyTest;
using test::thrown_message;

constexpr double kFloat = 1e-6;

TEST_F(ProcessPolicyTest, AnswersWithItsPlan) {
  start(polite("while m['type'] == 'observe':\n    plan(m)\n    m = read(c)\n"));
  for (const int tick : {0, 10, 20}) EXPECT_EQ(plan(tick), 100U);
  const std::vector<Reference> references = policy_->plan(history_.at(30));
  EXPECT_NEAR(references[50].X_WB.p.x(), 0.2, kFloat);
  EXPECT_NEAR(policy_->act(history_.at(40))[1].X_WB.p.x(), 0.1, kFloat);
  EXPECT_FALSE(policy_->faults().any());
  EXPECT_EQ(policy_->name(), "mine");
}

// The policy's inputs come back as a plan: joints of the newest frame, the size of everything in the root.
TEST_F(ProcessPolicyTest, IsToldTheEpisodeAndTheObservation) {
  start(polite(R"(
first = {e['name']: e['first'] for e in h['channels']}
assert h['version'] == 1 and h['rate_hz'] == 50 and h['robot'] == 'g1' and h['anchors'] == 5
assert [episode[k] for k in ('task', 'prompt', 'seed')] == ['wave', 'wave to the person', 7], episode
assert len(h['joints']) == len(h['neutral']) == len(h['lower']) == 29
f = m['frames']
assert len(f) == 12 and len(f[0]) == 149
q = f[-1][first['joint_positions']:][:29]
plan(m, [[f[0][0], f[-1][0], episode['start'][2], 1, 0, 0, 0] + q] * 5)
read(c)
)"));
  const Reference reference = policy_->plan(history_.at(0)).at(0);
  ASSERT_EQ(policy_->faults().message, "");
  const auto frames = history_.at(0).history;
  EXPECT_NEAR(reference.X_WB.p.x(), frames[0].partner(0, 0), kFloat);
  EXPECT_NEAR(reference.X_WB.p.y(), frames[11].partner(0, 0), kFloat);
  EXPECT_NEAR(reference.X_WB.p.z(), frames[11].robot.X_WB.p.z(), kFloat);
  const Eigen::VectorXd expected = frames[11].robot.q.cwiseMax(g1()->lower()).cwiseMin(g1()->upper());
  EXPECT_NEAR((reference.q - expected).cwiseAbs().maxCoeff(), 0.0, kFloat);
}

TEST_F(ProcessPolicyTest, LateCostsThatPlanAndTheLateAnswerIsDropped) {
  start(polite("later = read(c)\nplan(m, [[9, 9, 9, 1, 0, 0, 0] + [0] * 29] * 5)\nplan(later)\nread(c)\n"), 500);
  EXPECT_EQ(plan(0), 0U);
  EXPECT_EQ(policy_->faults().late, 1);
  EXPECT_SENTENCE(policy_->faults().message);
  const std::vector<Reference> references = policy_->plan(history_.at(10));
  ASSERT_EQ(references.size(), 100U);
  EXPECT_NEAR(references[0].X_WB.p.x(), 0.0, kFloat);
  EXPECT_EQ(policy_->faults().late, 1);
  EXPECT_FALSE(policy_->faults().dead);
}

// In lock-step simulation the clock of the wall decides nothing unless the descriptor says so.
TEST_F(ProcessPolicyTest, WithoutADeadlineASlowPlanIsWaitedFor) {
  start(polite("time.sleep(0.5)\nplan(m)\nread(c)\n"), 0);
  EXPECT_EQ(plan(0), 100U);
  EXPECT_FALSE(policy_->faults().any());
}

TEST_F(ProcessPolicyTest, WithoutADeadlineSilenceEndsItAtTheHangLimit) {
  start(polite("time.sleep(1000)\n"), 0);
  policy_ = make_policy(folder_ / "policy.yaml", g1(), {{"hang_ms", "100"}});
  policy_->reset(test::episode(history_.at(0).now().robot));
  EXPECT_EQ(plan(0), 0U);
  EXPECT_TRUE(policy_->faults().dead);
  EXPECT_EQ(policy_->faults().late, 0);
  EXPECT_SENTENCE(policy_->faults().message);
}

// Ctrl-C is heard while a program is silent, and is no fault of it.
TEST_F(ProcessPolicyTest, AStopEndsEveryWaitWithoutAFault) {
  EpisodeContext stopped = test::episode(history_.at(0).now().robot);
  stopped.stop_asked = [] { return true; };
  start(polite("time.sleep(1000)\n"), 0);
  policy_->reset(stopped);
  EXPECT_EQ(plan(0), 0U);
  EXPECT_FALSE(policy_->faults().any());
  write_file(folder_ / "policy.py", "import time\ntime.sleep(1000)\n");
  policy_ = make_policy(folder_ / "policy.yaml", g1());
  policy_->reset(stopped);
  EXPECT_EQ(plan(0), 0U);
  EXPECT_FALSE(policy_->faults().any());
}

// A program that reads nothing: the socket fills, no call blocks.
TEST_F(ProcessPolicyTest, LateForEverIsCountedAndNeverBlocks) {
  start(polite("time.sleep(1000)\n"), 5);
  for (int i = 0; i < 40; ++i) EXPECT_EQ(plan(10 * i), 0U);
  EXPECT_EQ(policy_->faults().late, 40);
  EXPECT_FALSE(policy_->faults().dead);
}

// Plans of earlier ticks that never end keep no call from ending.
TEST_F(ProcessPolicyTest, AFloodOfOldPlansIsLate) {
  start(polite("plan(m)\nwhile True:\n    plan(m)\n"), 200);
  static_cast<void>(plan(0));
  EXPECT_EQ(plan(10), 0U);
  EXPECT_GE(policy_->faults().late, 1);
}

TEST_F(ProcessPolicyTest, DeathIsReportedWithItsStatus) {
  start(polite("sys.exit(3)\n"));
  EXPECT_EQ(plan(0), 0U);
  EXPECT_TRUE(policy_->faults().dead);
  EXPECT_SENTENCE(policy_->faults().message);
  EXPECT_EQ(plan(10), 0U);
  policy_->reset(test::episode(history_.at(0).now().robot));
  EXPECT_TRUE(policy_->faults().dead);
}

TEST_F(ProcessPolicyTest, DeathBySignalIsReported) {
  start(polite("os.kill(os.getpid(), signal.SIGKILL)\n"));
  EXPECT_EQ(plan(0), 0U);
  EXPECT_SENTENCE(policy_->faults().message);
}

// Writing to it is no SIGPIPE.
TEST_F(ProcessPolicyTest, DeathBetweenCallsIsReported) {
  start(polite("plan(m)\nc.close()\nopen('done', 'w').close()\ntime.sleep(1000)\n"));
  EXPECT_EQ(plan(0), 100U);
  while (!std::filesystem::exists(folder_ / "done")) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(plan(10), 0U);
  EXPECT_SENTENCE(policy_->faults().message);
}

TEST_F(ProcessPolicyTest, NonsenseIsCountedAndNamed) {
  start(polite(R"(
bad = [[0.0] * 7 + [0] * 29] * 5
nan = [[float('nan'), 0, 0, 1, 0, 0, 0] + [0] * 29] * 5
def raw(text):
    c.sendall(struct.pack('<I', len(text)) + text)
for step in [lambda: plan(m, nan), lambda: plan(m, good[:4]), lambda: plan(m, [a[:35] for a in good]), lambda: plan(m, bad),
             lambda: plan(m, good[:4] + [[1]]), lambda: raw(b'hello?'), lambda: raw(b'\xff\xfe'), lambda: raw(b''),
             lambda: raw(b'[' * 100000), lambda: write(c, {'type': 'plan', 'tick': m['tick']}),
             lambda: write(c, {'type': 'ready'}), lambda: plan({'tick': m['tick'] + 1}),
             lambda: plan(m, [['a'] * 36] * 5), lambda: plan(m, [[1e300, 0, 0, 1, 0, 0, 0] + [0] * 29] * 5),
             lambda: plan(m)]:
    step()
    m = read(c)
)"));
  const std::vector<std::string> expected = {
      "message of the policy: expected finite numbers, found NaN",
      "plan: expected 5 anchors, found 4",
      "plan: expected 180 numbers (5 anchors of 36), found 175",
      "plan: anchor 0: expected a unit quaternion, found one of length 0",
      "message of the policy: 'anchors': anchor 4: expected as many numbers as before, found 1",
      "message of the policy: expected JSON, found 'hello?'",
      "message of the policy: expected JSON, found '?\?'",
      "message of the policy: expected JSON, found ''",
      "message of the policy: expected JSON, found '[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[...'",
      "message of the policy: expected the key 'anchors', found none",
      "expected 'plan', found 'ready'",
      "plan: expected tick 110, found 111",
      "message of the policy: 'anchors': anchor 0: expected numbers, found string",
      "plan: anchor 0, number 0: expected a finite number, found inf"};
  int tick = 0, invalid = 0;
  for (const std::string& message : expected) {
    EXPECT_EQ(plan(tick), 0U);
    EXPECT_EQ(policy_->faults().invalid, ++invalid) << message;
    if (invalid == 1) {
      EXPECT_EQ(policy_->faults().message, "policy 'mine': " + message);
    }
    tick += 10;
  }
  EXPECT_EQ(plan(tick), 100U);  // it goes on
  EXPECT_EQ(policy_->faults().late, 0);
  EXPECT_FALSE(policy_->faults().dead);
}

TEST_F(ProcessPolicyTest, ALengthOfFourGigabytesEndsIt) {
  start(polite("c.sendall(b'\\xff\\xff\\xff\\xff' + b'x' * 100)\nread(c)\n"));
  EXPECT_EQ(plan(0), 0U);
  EXPECT_TRUE(policy_->faults().dead);
  EXPECT_EQ(policy_->faults().invalid, 1);
  EXPECT_SENTENCE(policy_->faults().message);
}

TEST_F(ProcessPolicyTest, SilenceAtHelloEndsIt) {
  start("read(c)\ntime.sleep(1000)\n", 200, 100);
  EXPECT_EQ(plan(0), 0U);
  EXPECT_TRUE(policy_->faults().dead);
  EXPECT_SENTENCE(policy_->faults().message);
}

TEST_F(ProcessPolicyTest, SilenceAtResetEndsItAndIsQuotedOnce) {
  start("read(c)\nwrite(c, {'type': 'hello', 'version': 1})\ntime.sleep(1000)\n", 200, 4000);
  EXPECT_TRUE(policy_->faults().dead);
  EXPECT_SENTENCE(policy_->faults().message);
}

TEST_F(ProcessPolicyTest, AnotherVersionOrOrderOfJointsEndsIt) {
  start("read(c)\nwrite(c, {'type': 'hello', 'version': 2})\nread(c)\n");
  EXPECT_SENTENCE(policy_->faults().message);
  start("h = read(c)\nwrite(c, {'type': 'hello', 'version': 1, 'joints': h['joints'][::-1]})\nread(c)\n");
  EXPECT_SENTENCE(policy_->faults().message);
}

TEST_F(ProcessPolicyTest, AnotherFirstAnswerEndsIt) {
  start("read(c)\nwrite(c, {'type': 'ready'})\nread(c)\n");
  EXPECT_SENTENCE(policy_->faults().message);
  start("read(c)\nwrite(c, {'type': 'hello', 'version': 1, 'extra': 1})\nread(c)\n");
  EXPECT_SENTENCE(policy_->faults().message);
  EXPECT_TRUE(policy_->faults().dead);
}

TEST_F(ProcessPolicyTest, AScriptThatIsNotThereEndsIt) {
  write_descriptor("command: [python3, none.py]\n");
  policy_ = make_policy(folder_ / "policy.yaml", g1());
  policy_->reset(test::episode(history_.at(0).now().robot));  // hello is said here
  EXPECT_SENTENCE(policy_->faults().message);
  write_descriptor("command: [no_such_program]\n");
  EXPECT_SENTENCE(thrown_message<MissingError>([&] { policy_maker(folder_ / "policy.yaml", g1()); }));
  write_descriptor("command: [./none]\n");
  EXPECT_SENTENCE(thrown_message<MissingError>([&] { policy_maker(folder_ / "policy.yaml", g1()); }));
}

}  // namespace
}  // namespace duet
