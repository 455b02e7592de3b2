// A program as users of the maker's SDK write it, for tests: Cyclone DDS with the SDK's own configuration of an
// interface, default quality of service, a checksum of its own; nothing of the wires of this tree but its messages. It
// asks the motion_switcher which mode runs, releases it, moves the left elbow and prints what it saw, a line each.
//   sdk_client DOMAIN SECONDS
#include <dds/dds.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "g1.h"

namespace {

constexpr const char* kConfiguration =
    "<CycloneDDS><Domain Id=\"any\"><General><Interfaces><NetworkInterface name=\"lo\" priority=\"default\" "
    "multicast=\"default\"/></Interfaces></General></Domain></CycloneDDS>";
constexpr int kElbow = 18, kMotors = 29;
constexpr double kPeriod = 0.002;  // [s]

std::uint32_t checksum(const unitree_hg_msg_dds__LowCmd_& command) {
  std::uint32_t words[sizeof(command) / 4];
  std::memcpy(words, &command, sizeof(command));
  std::uint32_t crc = 0xFFFFFFFFu;
  for (std::size_t k = 0; k + 1 < sizeof(words) / 4; ++k)
    for (int bit = 31; bit >= 0; --bit) {
      const bool other = ((crc >> 31) ^ ((words[k] >> bit) & 1u)) != 0;
      crc = (crc << 1) ^ (other ? 0x04C11DB7u : 0u);
    }
  return crc;
}

class Client {
 public:
  explicit Client(int domain) {
    dds_create_domain(static_cast<dds_domainid_t>(domain), kConfiguration);
    participant_ = dds_create_participant(static_cast<dds_domainid_t>(domain), nullptr, nullptr);
    states_ = reader(unitree_hg_msg_dds__LowState__desc, "rt/lowstate");
    remotes_ = reader(unitree_go_msg_dds__WirelessController__desc, "rt/wirelesscontroller");
    imus_ = reader(unitree_hg_msg_dds__IMUState__desc, "rt/secondary_imu");
    commands_ = dds_create_writer(participant_, topic(unitree_hg_msg_dds__LowCmd__desc, "rt/lowcmd"), nullptr, nullptr);
    requests_ = dds_create_writer(
        participant_, topic(unitree_api_msg_dds__Request__desc, "rt/api/motion_switcher/request"), nullptr, nullptr);
    responses_ = reader(unitree_api_msg_dds__Response__desc, "rt/api/motion_switcher/response");
  }
  ~Client() { dds_delete(participant_); }

  void run(double seconds) {
    for (long tick = 0; static_cast<double>(tick) * kPeriod < seconds; ++tick) {
      take(states_, state_, state_count_);
      take(remotes_, remote_, remote_count_);
      take(imus_, imu_, imu_count_);
      hear();
      if (tick % 500 == 250) ask(tick < 500 ? 1003 : 1001);  // released once, then asked
      if (state_count_ > 0) command();
      usleep(static_cast<useconds_t>(1e6 * kPeriod));
    }
  }
  void print() const {
    const auto& motor = state_.motor_state[kElbow];
    std::printf("states %s\n", state_count_ > 500 ? "many" : state_count_ > 0 ? "few" : "none");
    std::printf("elbow %.2f\n", static_cast<double>(motor.q));
    std::printf("volts %.0f, winding %d\n", static_cast<double>(motor.vol), motor.temperature[1]);
    std::printf("remote %s, keys %d\n", remote_count_ > 100 ? "heard" : "silent", remote_.keys);
    const float* w = imu_.quaternion;
    std::printf("secondary imu %s, norm %.3f\n", imu_count_ > 500 ? "many" : "few",
                std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2] + w[3] * w[3]));
    std::printf("released with %d; mode %s\n", released_, mode_);
  }

 private:
  dds_entity_t topic(const dds_topic_descriptor_t& type, const char* name) const {
    return dds_create_topic(participant_, &type, name, nullptr, nullptr);
  }
  dds_entity_t reader(const dds_topic_descriptor_t& type, const char* name) const {
    return dds_create_reader(participant_, topic(type, name), nullptr, nullptr);
  }
  template <typename Sample>
  static void take(dds_entity_t reader, Sample& sample, long& count) {
    void* place = &sample;
    dds_sample_info_t info;
    Sample last = sample;
    if (dds_take(reader, &place, &info, 1, 1) > 0 && info.valid_data)
      ++count;
    else
      sample = last;
  }
  void hear() {
    void* place = nullptr;
    dds_sample_info_t info;
    if (dds_take(responses_, &place, &info, 1, 1) <= 0) return;
    const auto* response = static_cast<const unitree_api_msg_dds__Response_*>(place);
    if (info.valid_data && response->header.identity.api_id == 1003) released_ = response->header.status.code;
    if (info.valid_data && response->header.identity.api_id == 1001 && response->data != nullptr)
      std::snprintf(mode_, sizeof(mode_), "%s", response->data);
    dds_return_loan(responses_, &place, 1);
  }
  void ask(int call) {
    unitree_api_msg_dds__Request_ request{};
    request.header.identity.id = ++asked_;
    request.header.identity.api_id = call;
    char nothing[] = "{}";
    request.parameter = nothing;
    dds_write(requests_, &request);
  }
  void command() {
    unitree_hg_msg_dds__LowCmd_ command;
    std::memset(&command, 0, sizeof(command));
    command.mode_machine = state_.mode_machine;
    for (int j = 0; j < kMotors; ++j) {
      command.motor_cmd[j].mode = 1;
      command.motor_cmd[j].kp = 60.0f;
      command.motor_cmd[j].kd = 1.5f;
    }
    command.motor_cmd[kElbow].q = 0.5f;
    command.crc = checksum(command);
    dds_write(commands_, &command);
  }

  dds_entity_t participant_, states_, remotes_, imus_, commands_, requests_, responses_;
  unitree_hg_msg_dds__LowState_ state_{};
  unitree_go_msg_dds__WirelessController_ remote_{};
  unitree_hg_msg_dds__IMUState_ imu_{};
  long state_count_ = 0, remote_count_ = 0, imu_count_ = 0, asked_ = 0;
  int released_ = -1;
  char mode_[64] = "unknown";
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  Client client(std::atoi(argv[1]));
  client.run(std::atof(argv[2]));
  client.print();
  return 0;
}
