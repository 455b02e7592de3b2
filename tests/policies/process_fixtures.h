// Policies in processes of their own: tiny Python programs.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cerrno>
#include <memory>
#include <string>

#include "duet/core/child_process.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/external/external_policy.h"
#include "duet/policies/external/process_policy.h"
#include "tests/policies/external_fixtures.h"

namespace duet::test {

inline std::string examples() { return std::string(DUET_SOURCE_DIR) + "/examples/policies"; }

inline bool python_is_here() {
  try {
    return !find_program("python3", ".").empty();
  } catch (const MissingError&) {
    return false;
  }
}

class ProcessPolicyTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!python_is_here()) GTEST_SKIP() << "not run: python3 absent";
  }

  // After every test: no child is left, running or not reaped.
  void TearDown() override {
    policy_.reset();
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
    EXPECT_EQ(errno, ECHILD);
  }

  // `deadline_ms` 0: none. `script` after the import of duet_policy's functions, with `c` connected and the
  // observations' first answers given.
  Policy& start(const std::string& script, int deadline_ms = 5000, int start_ms = 20000) {
    write_file(folder_ / "policy.py", "import json, os, signal, socket, struct, sys, time\nsys.path.insert(0, '" +
                                          examples() + "')\nfrom duet_policy import read, write\n" +
                                          "c = socket.socket(fileno=int(os.environ['DUET_POLICY_FD']))\n" + script);
    write_descriptor(fmt::format("command: [python3, policy.py]\n{}start_ms: {}\n",
                                 deadline_ms > 0 ? fmt::format("deadline_ms: {}\n", deadline_ms) : "", start_ms));
    policy_ = make_policy(folder_ / "policy.yaml", g1());
    policy_->reset(test::episode(history_.at(0).now().robot));
    return *policy_;
  }

  void write_descriptor(const std::string& how) const {
    write_file(folder_ / "policy.yaml", "schema: duet.policy/1\nname: mine\nabout: a test\nkind: process\n" + how);
  }

  std::size_t plan(int tick) { return policy_->plan(history_.at(tick)).size(); }

  test::ScratchFolder folder_;
  MovingHistory history_{1};
  std::unique_ptr<Policy> policy_;
};

// A program that greets and says it is ready, and then `script` with the first observation in `m`.
inline std::string polite(const std::string& script) {
  return R"(h = read(c)
write(c, {'type': 'hello', 'version': 1})
episode = read(c)
write(c, {'type': 'ready'})
good = [[0.1 * i, 0, 0.75, 1, 0, 0, 0] + [0] * 29 for i in range(5)]
def plan(m, anchors=good):
    write(c, {'type': 'plan', 'tick': m['tick'], 'anchors': anchors})
m = read(c)
)" + script;
}

}  // namespace duet::test
