// A robot's end as a laboratory would write it that has the maker's published messages and no G1: Cyclone DDS and the
// messages of lab_robot.idl, its own checksum, its own reader of HOMIE's velocities; nothing of this tree. It publishes
// states at 500 Hz of joints that follow their gains and of a base that follows velocities, holds the keys as an
// operator would (dead-man, start, A, and select 2 s after it begins to walk), and checks every command.
//   lab_robot DOMAIN VELOCITY_PORT SECONDS
// prints to the standard error what it saw. Exit code: 0 as it should be, 1 a command or motion that must not be, 3 it
// was not led from damping to walking and to its stop, or commands came late.
#include "lab_robot.h"

#include <arpa/inet.h>
#include <dds/dds.h>
#include <sched.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <map>
#include <string>
#include <thread>

namespace {

using Command = unitree_hg_msg_dds__LowCmd_;
using State = unitree_hg_msg_dds__LowState_;
using Battery = unitree_hg_msg_dds__BmsState_;
using Odometry = unitree_go_msg_dds__SportModeState_;

constexpr const char* kConfiguration =
    "<CycloneDDS><Domain Id=\"any\"><General><Interfaces><NetworkInterface name=\"lo\" priority=\"default\" "
    "multicast=\"default\"/></Interfaces></General></Domain></CycloneDDS>";
constexpr int kMotors = 29, kMessageMotors = 35, kLeftElbow = 18, kFirstArm = 15;
constexpr int kModeMachine = 5;                                 // 29 joints, nothing of the waist locked
constexpr double kPeriod = 0.002;                               // [s]
constexpr double kInertia = 0.15;                               // of a joint with its motor and link [kg m^2]
constexpr double kFriction = 0.4;                               // [N m s/rad]
constexpr double kRootLag = 0.25;                               // [s]
constexpr double kWalks = 2.0;                                  // from its first velocity to the stop key [s]
constexpr double kStopWithin = 0.1;                             // from the stop key to the last command with gains [s]
constexpr double kRestWithin = 0.7;                             // to joints and base at rest [s]
constexpr double kWatches = 1.5;                                // after the stop key [s]
constexpr double kElbowAtFirst = 0.45;                          // [rad]
constexpr int kWinding = 61, kCharge = 73, kBatteryEvery = 25;  // [degrees C], [%], states
enum Key { kR1 = 0, kStart = 2, kSelect = 3, kA = 8 };

// Source: the maker's URDF of the G1 with 29 joints, revision 1.0. [rad], [N m]
struct Joint {
  double lower, upper, effort;
};
constexpr Joint kJoints[kMotors] = {
    {-2.5307, 2.8798, 88},  {-0.5236, 2.9671, 88},    {-2.7576, 2.7576, 88},   {-0.087267, 2.8798, 139},
    {-0.87267, 0.5236, 50}, {-0.2618, 0.2618, 50},    {-2.5307, 2.8798, 88},   {-2.9671, 0.5236, 88},
    {-2.7576, 2.7576, 88},  {-0.087267, 2.8798, 139}, {-0.87267, 0.5236, 50},  {-0.2618, 0.2618, 50},
    {-2.618, 2.618, 88},    {-0.52, 0.52, 50},        {-0.52, 0.52, 50},       {-3.0892, 2.6704, 25},
    {-1.5882, 2.2515, 25},  {-2.618, 2.618, 25},      {-1.0472, 2.0944, 25},   {-1.97222, 1.97222, 25},
    {-1.61443, 1.61443, 5}, {-1.61443, 1.61443, 5},   {-3.0892, 2.6704, 25},   {-2.2515, 1.5882, 25},
    {-2.618, 2.618, 25},    {-1.0472, 2.0944, 25},    {-1.97222, 1.97222, 25}, {-1.61443, 1.61443, 5},
    {-1.61443, 1.61443, 5}};

// The torques of legs that stand, knees bent by 0.67 rad, half of 35 kg above each ankle [N m]. A robot whose legs
// carry nothing hangs on its rope.
constexpr double kStanding[12] = {-4.7, -0.4, 0.2, -15.9, -0.1, 0.0, -4.7, 0.4, -0.2, -15.9, -0.1, 0.0};

// CRC-32/MPEG-2 over the words of a message in memory but its last one.
template <typename Message>
std::uint32_t checksum(const Message& message) {
  std::uint32_t words[sizeof(Message) / 4];
  std::memcpy(words, &message, sizeof(message));
  std::uint32_t crc = 0xFFFFFFFFu;
  for (std::size_t k = 0; k + 1 < sizeof(words) / 4; ++k) {
    crc ^= words[k];
    for (int bit = 0; bit < 32; ++bit) crc = (crc << 1) ^ ((crc >> 31) != 0 ? 0x04C11DB7u : 0u);
  }
  return crc;
}

// Counts what must not be, by name, and keeps the first of each.
class Violations {
 public:
  void unless(bool good, const char* name, double time, int joint, double value) {
    if (good) return;
    auto& [count, first] = seen_[name];
    char text[96];
    std::snprintf(text, sizeof(text), "first at %.3f s, motor %d, %.4f", time, joint, value);
    if (count++ == 0) first = text;
  }
  [[nodiscard]] bool any() const { return !seen_.empty(); }
  void print() const {
    for (const auto& [name, seen] : seen_)
      std::fprintf(stderr, "violation: %s, %ld times, %s\n", name.c_str(), seen.first, seen.second.c_str());
    std::fprintf(stderr, "violations %zu\n", seen_.size());
  }

 private:
  std::map<std::string, std::pair<long, std::string>> seen_;
};

// HOMIE's velocities as LCM brings them: "LC02", a number, the channel, the type's fingerprint, four doubles; all
// big-endian.
class Velocities {
 public:
  explicit Velocities(int port) : socket_(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0)) {
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(static_cast<std::uint16_t>(port));
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    good = bind(socket_, reinterpret_cast<const sockaddr*>(&at), sizeof(at)) == 0;
  }
  ~Velocities() { close(socket_); }
  // False where none waits, or it is no such message.
  bool take(double (&velocity)[4]) {
    constexpr char kChannel[] = "pedal_command";
    constexpr std::size_t kBegin = 8, kFields = kBegin + sizeof(kChannel) + 8, kSize = kFields + 32;
    constexpr std::uint64_t kFields64 = 0x507a292ea92a57d0u;
    unsigned char bytes[256];
    if (recv(socket_, bytes, sizeof(bytes), 0) != static_cast<ssize_t>(kSize)) return false;
    if (std::memcmp(bytes, "LC02", 4) != 0 || std::memcmp(bytes + kBegin, kChannel, sizeof(kChannel)) != 0)
      return false;
    if (big_endian(bytes + kFields - 8) != std::rotl(kFields64, 1)) return false;
    for (int k = 0; k < 4; ++k) velocity[k] = std::bit_cast<double>(big_endian(bytes + kFields + 8 * k));
    return true;
  }
  bool good = false;

 private:
  static std::uint64_t big_endian(const unsigned char* bytes) {
    std::uint64_t value = 0;
    for (int k = 0; k < 8; ++k) value = (value << 8) | bytes[k];
    return value;
  }
  int socket_;
};

// Joints that follow their gains without gravity, and a base that stands and follows velocities.
struct Body {
  Body() { q[kLeftElbow] = kElbowAtFirst; }
  void step(const Command& command) {
    for (int j = 0; j < kMotors; ++j) {
      const auto& motor = command.motor_cmd[j];
      double torque = 0.0;
      if (motor.mode == 1) torque = motor.kp * (motor.q - q[j]) + motor.kd * (motor.dq - v[j]) + motor.tau;
      tau[j] = std::clamp(torque, -kJoints[j].effort, kJoints[j].effort);
      v[j] += kPeriod * (tau[j] - kFriction * v[j]) / kInertia;
      const double next = q[j] + kPeriod * v[j];
      q[j] = std::clamp(next, kJoints[j].lower, kJoints[j].upper);
      if (q[j] != next) v[j] = 0.0;
    }
    for (int k = 0; k < 3; ++k) speed[k] += kPeriod / kRootLag * (asked[k] - speed[k]);
    yaw += kPeriod * speed[2];
    x += kPeriod * (std::cos(yaw) * speed[0] - std::sin(yaw) * speed[1]);
    y += kPeriod * (std::sin(yaw) * speed[0] + std::cos(yaw) * speed[1]);
  }
  double q[kMotors]{}, v[kMotors]{}, tau[kMotors]{};
  double speed[3]{}, asked[4]{};  // forward, sideways, turn, height [m/s, m/s, rad/s, m]
  double x = 0.0, y = 0.0, yaw = 0.0;
};

class LabRobot {
 public:
  LabRobot(int domain, int port) : velocities_(port) {
    dds_create_domain(static_cast<dds_domainid_t>(domain), kConfiguration);
    participant_ = dds_create_participant(static_cast<dds_domainid_t>(domain), nullptr, nullptr);
    const auto topic = [&](const dds_topic_descriptor_t& type, const char* name) {
      return dds_create_topic(participant_, &type, name, nullptr, nullptr);
    };
    const auto writer = [&](const dds_topic_descriptor_t& type, const char* name) {
      return dds_create_writer(participant_, topic(type, name), nullptr, nullptr);
    };
    states_ = writer(unitree_hg_msg_dds__LowState__desc, "rt/lowstate");
    batteries_ = writer(unitree_hg_msg_dds__BmsState__desc, "rt/lf/bmsstate");
    odometry_ = writer(unitree_go_msg_dds__SportModeState__desc, "rt/odommodestate");
    dds_qos_t* all = dds_create_qos();
    dds_qset_history(all, DDS_HISTORY_KEEP_LAST, 64);
    commands_ = dds_create_reader(participant_, topic(unitree_hg_msg_dds__LowCmd__desc, "rt/lowcmd"), all, nullptr);
    dds_delete_qos(all);
  }
  ~LabRobot() { dds_delete(participant_); }

  int run(double seconds) {
    if (participant_ < 0 || states_ < 0 || batteries_ < 0 || odometry_ < 0 || commands_ < 0 || !velocities_.good) {
      std::fprintf(stderr, "lab_robot: cannot open its topics or its port\n");
      return 3;
    }
    auto next = std::chrono::steady_clock::now();
    while (time_ < seconds && !over()) {
      time_ += kPeriod;
      hear();
      walk();
      body_.step(last_);
      judge_motion();
      press();
      publish();
      next += std::chrono::microseconds(2000);
      std::this_thread::sleep_until(next);
    }
    return print();
  }

 private:
  [[nodiscard]] bool stopped_for(double seconds) const { return stopped_at_ > 0.0 && time_ > stopped_at_ + seconds; }
  [[nodiscard]] bool over() const { return stopped_for(kWatches); }
  void unless(bool good, const char* name, int joint = -1, double value = 0.0) {
    violations_.unless(good, name, time_, joint, value);
  }

  void hear() {
    Command command;
    std::memset(&command, 0, sizeof(command));  // the reader leaves padding as it is, and the checksum is over it
    void* place = &command;
    dds_sample_info_t info;
    while (dds_take(commands_, &place, &info, 1, 1) > 0)
      if (info.valid_data) judge(command);
    longest_gap_ = count_ > 0 ? std::max(longest_gap_, time_ - heard_at_) : 0.0;
  }
  void judge(const Command& command) {
    unless(command.crc == checksum(command), "checksum");
    unless(command.mode_pr == 0, "mode_pr", -1, command.mode_pr);
    unless(command.mode_machine == kModeMachine, "mode_machine", -1, command.mode_machine);
    bool damps = true;
    for (int j = 0; j < kMotors; ++j) damps = judge_motor(j, command.motor_cmd[j]) && damps;
    for (int j = kMotors; j < kMessageMotors; ++j) {
      constexpr unitree_hg_msg_dds__MotorCmd_ kNothing{};
      unless(std::memcmp(&command.motor_cmd[j], &kNothing, sizeof(kNothing)) == 0, "a motor that is not there", j);
    }
    if (stopped_for(kStopWithin)) unless(damps, "gains after the stop");
    if (count_++ == 0) {
      first_at_ = time_;
      unless(damps, "gains before damping");
    }
    (damps ? damped_ : held_) += 1;
    heard_at_ = time_;
    last_ = command;
  }
  // Whether it damps.
  bool judge_motor(int j, const unitree_hg_msg_dds__MotorCmd_& motor) {
    const bool finite = std::isfinite(motor.q) && std::isfinite(motor.dq) && std::isfinite(motor.tau) &&
                        std::isfinite(motor.kp) && std::isfinite(motor.kd);
    unless(finite, "not finite", j);
    unless(motor.mode == 1, "motor mode", j, motor.mode);
    unless(motor.kp >= 0.0f && motor.kd >= 0.0f && motor.dq == 0.0f, "gains or speed", j, motor.kd);
    const double q = motor.q, torque = motor.kp * (q - body_.q[j]);
    if (motor.kp == 0.0f) {
      unless(motor.kd == 8.0f && motor.tau == 0.0f, "damping", j, motor.kd);
      return true;
    }
    unless(q >= kJoints[j].lower - 1e-4 && q <= kJoints[j].upper + 1e-4, "limits of a joint", j, q);
    if (held_ == 0) unless(std::abs(q - body_.q[j]) < 0.05, "a step at the first gains", j, q - body_.q[j]);
    if (j >= kFirstArm) unless(std::abs(torque) < 0.5 * kJoints[j].effort, "half an arm's effort", j, torque);
    return false;
  }
  void walk() {
    while (velocities_.take(body_.asked)) {
      constexpr double kMost[3] = {0.25, 0.15, 0.5};  // of the guard's documented ceilings [m/s, m/s, rad/s]
      for (int k = 0; k < 3; ++k) {
        unless(std::abs(body_.asked[k]) <= kMost[k] + 1e-6, "velocity", k, body_.asked[k]);
        if (stopped_for(kStopWithin)) unless(body_.asked[k] == 0.0, "velocity after the stop", k, body_.asked[k]);
      }
      if (walks_at_ == 0.0 && std::abs(body_.asked[0]) > 0.01) walks_at_ = time_;
    }
  }
  void judge_motion() {
    for (int j = 0; j < kMotors; ++j) {
      unless(std::abs(body_.v[j]) < 1.5, "speed of a joint", j, body_.v[j]);
      if (stopped_for(kRestWithin)) unless(std::abs(body_.v[j]) < 0.05, "motion after the stop", j, body_.v[j]);
    }
    lowest_elbow_ = std::min(lowest_elbow_, body_.q[kLeftElbow]);
    highest_elbow_ = std::max(highest_elbow_, body_.q[kLeftElbow]);
    if (stopped_for(kRestWithin)) unless(std::hypot(body_.speed[0], body_.speed[1]) < 0.05, "the base after the stop");
  }

  // The operator: R1 throughout; start once it was damped for half a second, A in turn until it walks, then select.
  void press() {
    keys_ = 1u << kR1;
    const bool tapped = std::fmod(time_, 0.5) < 0.1;
    if (walks_at_ > 0.0 && time_ > walks_at_ + kWalks) {
      if (stopped_at_ == 0.0) stopped_at_ = time_;
      if (!stopped_for(0.2)) keys_ |= 1u << kSelect;
    } else if (held_ > 0) {
      keys_ |= tapped && walks_at_ == 0.0 ? 1u << kA : 0u;
    } else if (count_ > 0 && time_ > first_at_ + 0.5 && tapped) {
      keys_ |= 1u << kStart;
    }
  }
  double noise(double size) {
    random_ = random_ * 6364136223846793005u + 1442695040888963407u;
    return size * (static_cast<double>(random_ >> 11) / 4503599627370496.0 - 1.0);
  }
  void publish() {
    State state;
    std::memset(&state, 0, sizeof(state));  // padding is in the checksum
    state.mode_machine = kModeMachine;
    state.tick = ++tick_;
    auto& imu = state.imu_state;
    imu.quaternion[0] = static_cast<float>(std::cos(0.5 * body_.yaw));
    imu.quaternion[3] = static_cast<float>(std::sin(0.5 * body_.yaw));
    imu.rpy[2] = static_cast<float>(body_.yaw);
    for (int k = 0; k < 3; ++k) {
      imu.gyroscope[k] = static_cast<float>((k == 2 ? body_.speed[2] : 0.0) + noise(0.005));
      imu.accelerometer[k] = static_cast<float>((k == 2 ? 9.81 : 0.0) + noise(0.05));
    }
    for (int j = 0; j < kMotors; ++j) {
      auto& motor = state.motor_state[j];
      motor.mode = last_.motor_cmd[j].mode;
      motor.q = static_cast<float>(body_.q[j] + noise(0.0005));
      motor.dq = static_cast<float>(body_.v[j] + noise(0.01));
      const bool stands = j < static_cast<int>(std::size(kStanding)) && last_.motor_cmd[j].kp > 0.0f;
      motor.tau_est = static_cast<float>(body_.tau[j] + (stands ? kStanding[j] : 0.0));
      motor.temperature[0] = 38;
      motor.temperature[1] = j == kLeftElbow ? kWinding : 42;
      motor.vol = 50.0f;
    }
    state.wireless_remote[2] = static_cast<std::uint8_t>(keys_ & 0xFF);
    state.wireless_remote[3] = static_cast<std::uint8_t>(keys_ >> 8);
    state.crc = checksum(state);
    dds_write(states_, &state);
    publish_beside(imu);
  }
  void publish_beside(const unitree_hg_msg_dds__IMUState_& imu) {
    Odometry odometry{};
    odometry.imu_state.quaternion[0] = imu.quaternion[0];
    odometry.imu_state.quaternion[3] = imu.quaternion[3];
    odometry.position[0] = static_cast<float>(body_.x);
    odometry.position[1] = static_cast<float>(body_.y);
    odometry.position[2] = 0.74f;
    odometry.velocity[0] = static_cast<float>(std::cos(body_.yaw) * body_.speed[0]);
    odometry.velocity[1] = static_cast<float>(std::sin(body_.yaw) * body_.speed[0]);
    dds_write(odometry_, &odometry);
    Battery battery{};
    battery.soc = kCharge;
    if (tick_ % kBatteryEvery == 0) dds_write(batteries_, &battery);
  }

  int print() {
    const double commanded = heard_at_ - first_at_;
    const double rate = commanded > 0.0 ? static_cast<double>(count_ - 1) / commanded : 0.0;
    const bool in_time = rate > 400.0 && rate < 600.0 && longest_gap_ < 0.1;
    std::fprintf(stderr, "commands %ld at %.0f Hz, %ld of them damp, the longest silence %.3f s\n", count_, rate,
                 damped_, longest_gap_);
    std::fprintf(stderr, "elbow from %.2f to %.2f rad, walked %.2f m\n", lowest_elbow_, highest_elbow_, body_.x);
    std::fprintf(stderr, "%s, %s\n",
                 over()            ? "stopped"
                 : walks_at_ > 0.0 ? "walks"
                 : held_ > 0       ? "held"
                                   : "not held",
                 in_time ? "in time" : "late");
    violations_.print();
    return violations_.any() ? 1 : over() && in_time ? 0 : 3;
  }

  dds_entity_t participant_ = 0, states_ = 0, batteries_ = 0, odometry_ = 0, commands_ = 0;
  Velocities velocities_;
  Body body_;
  Command last_{};
  Violations violations_;
  double time_ = 0.0, first_at_ = 0.0, heard_at_ = 0.0, walks_at_ = 0.0, stopped_at_ = 0.0, longest_gap_ = 0.0;  // [s]
  double lowest_elbow_ = 10.0, highest_elbow_ = -10.0;  // [rad]
  long count_ = 0, damped_ = 0, held_ = 0;
  std::uint32_t tick_ = 0, keys_ = 0;
  std::uint64_t random_ = 41;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  const sched_param priority{.sched_priority = 10};
  (void)sched_setscheduler(0, SCHED_FIFO, &priority);  // where the system lets it
  LabRobot robot(std::atoi(argv[1]), std::atoi(argv[2]));
  return robot.run(std::atof(argv[3]));
}
