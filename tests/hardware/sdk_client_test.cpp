// The twin and its stand-ins before a program of the maker's SDK (sdk_client.cpp), where the loopback interface has
// multicast and where it has none: each in a network of its own, in the domain of unitree_mujoco.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>

namespace duet {
namespace {

struct ShellAnswer {
  int code = -1;
  std::string out;
};

ShellAnswer shell(const std::string& command) {
  ShellAnswer answer;
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return answer;
  char buffer[512];
  while (const std::size_t size = fread(buffer, 1, sizeof(buffer), pipe)) answer.out.append(buffer, size);
  answer.code = pclose(pipe);
  return answer;
}

// In a network that has nothing but "lo"; what still runs when the command is over is ended.
ShellAnswer alone(const std::string& multicast, const std::string& command) {
  return shell("unshare -rnpf sh -c 'ip link set lo up multicast " + multicast + " && " + command + "' 2>&1");
}

void expect_a_g1(const std::string& multicast) {
  if (const ShellAnswer possible = alone(multicast, "true"); possible.code != 0)
    GTEST_SKIP() << "not run: no network of its own can be made here: " << possible.out;
  const std::string places = " --domain 1 --seconds 20 >/dev/null & ";
  const ShellAnswer answer = alone(multicast, DUET_TWIN " --operated" + places + DUET_SERVICES " --switcher" + places +
                                                  "sleep 1; " + DUET_SDK_CLIENT " 1 4");
  // Told to go to 0.50, without any torque for what it carries.
  EXPECT_NE(answer.out.find("states many\nelbow 0.53\nvolts 48, winding 40\n"), std::string::npos) << answer.out;
  EXPECT_NE(answer.out.find("remote heard, keys 1\n"), std::string::npos) << answer.out;  // R1
  EXPECT_NE(answer.out.find("secondary imu many, norm 1.000\n"), std::string::npos) << answer.out;
  EXPECT_NE(answer.out.find("released with 0; mode {\"form\":\"0\",\"name\":\"\"}\n"), std::string::npos) << answer.out;
}

TEST(SdkClient, FindsAG1WhereLoopbackHasMulticast) { expect_a_g1("on"); }
TEST(SdkClient, FindsAG1WhereLoopbackHasNone) { expect_a_g1("off"); }

}  // namespace
}  // namespace duet
