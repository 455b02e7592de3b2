// Events that a policy in a process of its own outlives, and those that end with it.
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
