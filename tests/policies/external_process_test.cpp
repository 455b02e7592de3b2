// Policies in processes of their own: tiny Python programs, most of which misbehave.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "duet/core/child_process.h"
#include "duet/core/require.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/external/external_policy.h"
#include "duet/policies/external/process_policy.h"
#include "duet/robots/kinematics.h"
#include "tests/policies/process_fixtures.h"

namespace duet {
namespace {

using test::ends;
using test::examples;
using test::g1;
using test::MovingHistory;
using test::number_in;
using test::polite;
using test::ProcessPolicyTest;
using test::runs;
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

// Events that a policy in a process of its own outlives, and those that end with it.

TEST_F(ProcessPolicyTest, OptionsSetItsTimes) {
  write_descriptor("command: [python3, none.py]\n");
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] {
    policy_maker(folder_ / "policy.yaml", g1(), {{"deadline_ms", "soon"}});
  }));
  EXPECT_EQ(policy_info(folder_ / "policy.yaml").options.at(0).fallback, "");
  EXPECT_EQ(policy_info(folder_ / "policy.yaml").options.at(1).fallback, "60000");
  EXPECT_EQ(policy_info(folder_ / "policy.yaml").options.at(2).fallback, "120000");
}

TEST_F(ProcessPolicyTest, APlanOfAnEarlierEpisodeIsDropped) {
  start(polite(R"(
again = read(c)
write(c, {'type': 'plan', 'tick': 0, 'anchors': [[9, 9, 9, 1, 0, 0, 0] + [0] * 29] * 5})
write(c, {'type': 'ready'})
plan(read(c))
read(c)
)"),
        100);
  EXPECT_EQ(plan(0), 0U);
  policy_->reset(test::episode(history_.at(0).now().robot));
  EXPECT_FALSE(policy_->faults().any());
  const std::vector<Reference> references = policy_->plan(history_.at(0));
  if (policy_->faults().late == 0) {  // a busy machine
    ASSERT_EQ(references.size(), 100U);
    EXPECT_NEAR(references[0].X_WB.p.x(), 0.0, kFloat);
  }
}

TEST_F(ProcessPolicyTest, ObservationsThatAreNotFiniteAreNotSent) {
  start(polite("while m['type'] == 'observe':\n    plan(m)\n    m = read(c)\n"));
  MovingHistory broken(1);
  broken.frame(3).robot.v[2] = std::nan("");
  EXPECT_TRUE(policy_->plan(broken.at(0)).empty());
  EXPECT_EQ(policy_->faults().invalid, 1);
  EXPECT_EQ(plan(10), 100U);
}

const std::string kDeaf = polite(R"(
plan(m)
f = open('pid.tmp', 'w')
f.write(str(os.getpid()) + '\n')
f.close()
os.rename('pid.tmp', 'pid')
while True:
    time.sleep(1000)
)");

TEST_F(ProcessPolicyTest, IsKilledWithThePolicyThoughItDoesNotListen) {
  start(kDeaf);
  EXPECT_EQ(plan(0), 100U);
  const int pid = number_in(folder_ / "pid");
  EXPECT_TRUE(runs(pid));
  policy_.reset();
  EXPECT_FALSE(runs(pid));
}

TEST_F(ProcessPolicyTest, OutlivesTheThreadThatMadeIt) {
  std::thread([this] { start(polite("while m['type'] == 'observe':\n    plan(m)\n    m = read(c)\n")); }).join();
  for (const int tick : {0, 10, 20}) EXPECT_EQ(plan(tick), 100U);
  EXPECT_FALSE(policy_->faults().any());
}

TEST_F(ProcessPolicyTest, DoesNotOutliveAKilledParent) {
  const int parent = fork();
  ASSERT_GE(parent, 0);
  if (parent == 0) {
    start(kDeaf);
    static_cast<void>(plan(0));
    pause();
    _exit(0);
  }
  const int pid = number_in(folder_ / "pid");
  EXPECT_GT(pid, 0);
  kill(parent, SIGKILL);
  waitpid(parent, nullptr, 0);
  EXPECT_TRUE(ends(pid));
}

TEST_F(ProcessPolicyTest, MayBeAServerThatRuns) {
  write_file(folder_ / "server.py", "import sys\nsys.path.insert(0, '" + examples() + R"(')
from duet_policy import serve
class Still:
    def __init__(self, hello): pass
    def reset(self, episode): pass
    def plan(self, observation): return [[0, 0, 0.75, 1, 0, 0, 0] + [0] * 29] * 5
serve(Still, 'here.sock')
)");
  write_descriptor("socket: here.sock\ndeadline_ms: 5000\n");
  const auto refused = make_policy(folder_ / "policy.yaml", g1());
  EXPECT_TRUE(refused->faults().dead);
  EXPECT_SENTENCE(refused->faults().message);
  const ChildProcess server({"env", "-u", "DUET_POLICY_FD", "python3", "server.py"},
                            std::filesystem::path(folder_ / "x").parent_path().string(), "DUET_POLICY_FD", 0);
  std::unique_ptr<Policy> first;
  for (int i = 0; i < 2000 && (first == nullptr || first->faults().dead); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    first = make_policy(folder_ / "policy.yaml", g1());
  }
  const auto second = make_policy(folder_ / "policy.yaml", g1());  // two at once
  for (Policy* policy : {first.get(), second.get()}) {
    EXPECT_EQ(policy->faults().message, "");
    policy->reset(test::episode(history_.at(0).now().robot));
    EXPECT_EQ(policy->plan(history_.at(0)).size(), 100U);
  }
}

// The example raises its hand above its shoulder and swings it, and stands still while nobody is near.
TEST_F(ProcessPolicyTest, TheExampleWaves) {
  const auto policy = make_policy(examples() + "/wave_policy.yaml", g1(), {{"deadline_ms", "5000"}});
  MovingHistory history(1);
  RobotState start = g1()->standing_state();
  policy->reset(test::episode(start));
  history.frame(11).partner.col(0) = Eigen::Vector3d(1.0, 0.0, 0.9);
  const std::vector<Reference> plan = policy->plan(history.at(0));
  ASSERT_EQ(policy->faults().message, "");
  Kinematics kinematics(*g1());
  const auto hand = [&](const Reference& reference) {
    kinematics.update(reference.X_WB, reference.q);
    return Eigen::Vector3d(kinematics.frame_position(g1()->track_frame("rhand")) -
                           kinematics.frame_position(g1()->track_frame("rshoulder")));
  };
  EXPECT_GT(hand(plan[0]).z(), 0.1);
  EXPECT_GT(std::abs(hand(plan[0]).y() - hand(plan[50]).y()), 0.1);
  EXPECT_LT((plan[0].X_WB.p - start.X_WB.p).norm(), kFloat);
  history.frame(11).partner.col(0) = Eigen::Vector3d(9.0, 0.0, 0.9);
  EXPECT_LT((policy->plan(history.at(10)).at(0).q - g1()->neutral).norm(), kFloat);
}

}  // namespace
}  // namespace duet
