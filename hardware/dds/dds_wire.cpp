#include "duet/hardware/dds/dds_wire.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <span>

#include "duet/core/digest.h"
#include "duet/core/require.h"
#include "duet/hardware/dds/dds_participant.h"
#include "g1.h"

namespace duet {
namespace {

using CommandSample = unitree_hg_msg_dds__LowCmd_;
using StateSample = unitree_hg_msg_dds__LowState_;
using OdometryMessage = unitree_go_msg_dds__SportModeState_;
using BatteryMessage = unitree_hg_msg_dds__BmsState_;
using RemoteMessage = unitree_go_msg_dds__WirelessController_;
static_assert(sizeof(CommandSample) == sizeof(LowCommandFrame) && sizeof(StateSample) == sizeof(LowStateFrame));
static_assert(sizeof(unitree_hg_msg_dds__IMUState_) == sizeof(ImuFrame));

constexpr const char* kCommandTopic = "rt/lowcmd";
constexpr const char* kStateTopic = "rt/lowstate";
constexpr const char* kOdometryTopic = "rt/odommodestate";
constexpr const char* kBatteryTopic = "rt/lf/bmsstate";
constexpr const char* kRemoteTopic = "rt/wirelesscontroller";
constexpr const char* kTrunkImuTopic = "rt/secondary_imu";

class DdsRobotWire final : public RobotWire {
 public:
  explicit DdsRobotWire(const DdsPlace& place)
      : participant_(place),
        states_(participant_.reader(unitree_hg_msg_dds__LowState__desc, kStateTopic)),
        odometry_(participant_.reader(unitree_go_msg_dds__SportModeState__desc, kOdometryTopic)),
        battery_(participant_.reader(unitree_hg_msg_dds__BmsState__desc, kBatteryTopic)),
        others_(participant_) {}

  bool take(LowStateFrame& frame) override {
    StateSample sample;
    if (!take_sample(states_, sample)) return false;
    std::memcpy(&frame, &sample, sizeof(frame));
    return true;
  }
  bool take(OdometrySample& sample) override {
    OdometryMessage message;
    if (!take_sample(odometry_, message)) return false;
    const float* quat_wxyz = message.imu_state.quaternion;
    sample.X_WB.R = Eigen::Quaterniond(quat_wxyz[0], quat_wxyz[1], quat_wxyz[2], quat_wxyz[3]);
    for (int axis = 0; axis < 3; ++axis) {
      sample.X_WB.p[axis] = message.position[axis];
      sample.v_WB[axis] = message.velocity[axis];
    }
    sample.valid = message.error_code == 0 && sample.X_WB.R.norm() > 0.5;
    if (sample.valid) sample.X_WB.R.normalize();
    return true;
  }
  bool take(BatteryReading& reading) override {
    BatteryMessage message;
    if (!take_sample(battery_, message)) return false;
    reading.charge = message.soc;
    return true;
  }
  bool wait(double most) override { return states_wait_.wait(states_, most); }
  int foreign_writers() override { return others_.of(kCommandTopic); }
  void open_writer() override {
    if (writer_ == 0) writer_ = participant_.writer(unitree_hg_msg_dds__LowCmd__desc, kCommandTopic);
  }
  void close_writer() override {
    if (writer_ != 0) dds_delete(writer_);
    writer_ = 0;
  }
  [[nodiscard]] bool has_writer() const override { return writer_ != 0; }
  bool write(const LowCommandFrame& frame) override {
    return writer_ != 0 && dds_write(writer_, &frame) == DDS_RETCODE_OK;
  }

 private:
  Participant participant_;
  dds_entity_t states_, odometry_, battery_, writer_ = 0;
  WriterCount others_;
  DataWait states_wait_{participant_.entity()};
};

class DdsTwinWire final : public TwinWire {
 public:
  explicit DdsTwinWire(const DdsPlace& place)
      : participant_(place),
        commands_(participant_.reader(unitree_hg_msg_dds__LowCmd__desc, kCommandTopic)),
        states_(participant_.writer(unitree_hg_msg_dds__LowState__desc, kStateTopic)),
        odometry_(participant_.writer(unitree_go_msg_dds__SportModeState__desc, kOdometryTopic)),
        battery_(participant_.writer(unitree_hg_msg_dds__BmsState__desc, kBatteryTopic)),
        remote_(participant_.writer(unitree_go_msg_dds__WirelessController__desc, kRemoteTopic)),
        trunk_imu_(participant_.writer(unitree_hg_msg_dds__IMUState__desc, kTrunkImuTopic)),
        others_(participant_) {}

  bool take(LowCommandFrame& frame) override {
    CommandSample sample;
    if (!take_sample(commands_, sample)) return false;
    std::memcpy(&frame, &sample, sizeof(frame));
    return true;
  }
  void write(const LowStateFrame& frame) override { (void)dds_write(states_, &frame); }
  void write(const OdometrySample& sample) override {
    OdometryMessage message{};
    const double quat_wxyz[4] = {sample.X_WB.R.w(), sample.X_WB.R.x(), sample.X_WB.R.y(), sample.X_WB.R.z()};
    for (int k = 0; k < 4; ++k) message.imu_state.quaternion[k] = static_cast<float>(quat_wxyz[k]);
    for (int axis = 0; axis < 3; ++axis) {
      message.position[axis] = static_cast<float>(sample.X_WB.p[axis]);
      message.velocity[axis] = static_cast<float>(sample.v_WB[axis]);
    }
    (void)dds_write(odometry_, &message);
  }
  void write(const BatteryReading& reading) override {
    BatteryMessage message{};
    message.soc = static_cast<std::uint8_t>(reading.charge > 0.0 ? std::min(reading.charge, 100.0) : 0.0);
    (void)dds_write(battery_, &message);
  }
  void write(const RemoteControl& remote) override {
    if (!remote.heard) return;
    const RemoteMessage message{
        .lx = remote.lx, .ly = remote.ly, .rx = remote.rx, .ry = remote.ry, .keys = remote.keys};
    (void)dds_write(remote_, &message);
  }
  void write(const ImuFrame& imu) override { (void)dds_write(trunk_imu_, &imu); }
  int command_writers() override { return others_.of(kCommandTopic); }
  bool wait(double most) override { return commands_wait_.wait(commands_, most); }

 private:
  Participant participant_;
  dds_entity_t commands_, states_, odometry_, battery_, remote_, trunk_imu_;
  WriterCount others_;
  DataWait commands_wait_{participant_.entity()};
};

}  // namespace

bool has_dds() { return true; }

std::unique_ptr<RobotWire> open_robot_wire(const DdsPlace& place) { return std::make_unique<DdsRobotWire>(place); }

std::unique_ptr<TwinWire> open_twin_wire(const DdsPlace& place) {
  check_twin_place(place);
  return std::make_unique<DdsTwinWire>(place);
}

std::string dds_type_digest(const std::string& type) {
  for (const dds_topic_descriptor_t* known :
       {&unitree_hg_msg_dds__MotorCmd__desc, &unitree_hg_msg_dds__LowCmd__desc, &unitree_hg_msg_dds__IMUState__desc,
        &unitree_hg_msg_dds__MotorState__desc, &unitree_hg_msg_dds__LowState__desc, &unitree_go_msg_dds__IMUState__desc,
        &unitree_go_msg_dds__PathPoint__desc, &unitree_go_msg_dds__TimeSpec__desc,
        &unitree_go_msg_dds__SportModeState__desc, &unitree_go_msg_dds__WirelessController__desc,
        &unitree_hg_msg_dds__BmsState__desc, &unitree_api_msg_dds__Request__desc,
        &unitree_api_msg_dds__Response__desc}) {
    if (type != known->m_typename) continue;
    Sha256 digest;
    digest.update(std::as_bytes(std::span(known->type_information.data, known->type_information.sz)));
    digest.update(std::as_bytes(std::span(known->type_mapping.data, known->type_mapping.sz)));
    return digest.hex();
  }
  throw std::invalid_argument(fmt::format("DDS: expected a type of the G1, found '{}'", type));
}

namespace {

using ArmSample = unitree_hg_msg_dds__LowCmd_;
using RequestSample = unitree_api_msg_dds__Request_;
using ResponseSample = unitree_api_msg_dds__Response_;

constexpr const char* kArmTopic = "rt/arm_sdk";
constexpr int kCallsKept = 32;  // a call that is overwritten is lost

std::string topic_of(Service service, const char* end) {
  return fmt::format("rt/api/{}/{}", kServiceNames[static_cast<std::size_t>(service)], end);
}

// The oldest sample lent by DDS; null where there is none. It is given back by the destructor.
template <typename Sample>
class Loan {
 public:
  explicit Loan(dds_entity_t reader) : reader_(reader), count_(dds_take(reader, &place_, &info_, 1, 1)) {}
  ~Loan() {
    if (count_ > 0) dds_return_loan(reader_, &place_, count_);
  }
  Loan(const Loan&) = delete;
  Loan& operator=(const Loan&) = delete;
  [[nodiscard]] const Sample* get() const {
    return count_ > 0 && info_.valid_data ? static_cast<const Sample*>(place_) : nullptr;
  }

 private:
  dds_entity_t reader_;
  void* place_ = nullptr;
  dds_sample_info_t info_{};
  dds_return_t count_;
};

class DdsSportWire final : public SportWire {
 public:
  DdsSportWire(const DdsPlace& place, std::span<const Service> services) : participant_(place), others_(participant_) {
    for (const Service service : services) calls_[static_cast<std::size_t>(service)] = open(service);
  }

  bool take(RpcResponse& response) override {
    return std::ranges::any_of(calls_,
                               [&](const Calls& calls) { return calls.responses != 0 && take(calls, response); });
  }
  bool request(const RpcRequest& request) override {
    RequestSample sample{};
    sample.header.identity.id = request.id;
    sample.header.identity.api_id = static_cast<std::int64_t>(request.call);
    parameter_ = request.parameter;
    sample.parameter = parameter_.data();
    const Calls& calls = calls_[static_cast<std::size_t>(service_of(request.call))];
    return calls.requests != 0 && dds_write(calls.requests, &sample) == DDS_RETCODE_OK;
  }
  int arm_writers() override { return others_.of(kArmTopic); }
  void open_arms() override {
    if (arms_ == 0) arms_ = participant_.writer(unitree_hg_msg_dds__LowCmd__desc, kArmTopic);
  }
  void close_arms() override {
    if (arms_ != 0) dds_delete(arms_);
    arms_ = 0;
  }
  bool write_arms(const LowCommandFrame& frame) override {
    return arms_ != 0 && dds_write(arms_, &frame) == DDS_RETCODE_OK;
  }

 private:
  struct Calls {
    dds_entity_t requests = 0, responses = 0;
  };
  Calls open(Service service) {
    return {
        participant_.writer(unitree_api_msg_dds__Request__desc, topic_of(service, "request").c_str(), kCallsKept),
        participant_.reader(unitree_api_msg_dds__Response__desc, topic_of(service, "response").c_str(), kCallsKept)};
  }
  static bool take(const Calls& calls, RpcResponse& response) {
    const Loan<ResponseSample> loan(calls.responses);
    const ResponseSample* sample = loan.get();
    if (sample == nullptr) return false;
    response.id = sample->header.identity.id;
    response.api = sample->header.identity.api_id;
    response.code = sample->header.status.code;
    response.data = sample->data == nullptr ? "" : sample->data;
    return true;
  }

  Participant participant_;
  std::array<Calls, kServiceNames.size()> calls_{};
  dds_entity_t arms_ = 0;
  WriterCount others_;
  std::array<char, 96> parameter_{};
};

class DdsServices final : public ServicesWire {
 public:
  DdsServices(const DdsPlace& place, std::span<const Service> services)
      : participant_(place), arms_(participant_.reader(unitree_hg_msg_dds__LowCmd__desc, kArmTopic)) {
    for (const Service service : services) {
      Calls& calls = of(service);
      calls.requests =
          participant_.reader(unitree_api_msg_dds__Request__desc, topic_of(service, "request").c_str(), kCallsKept);
      calls.responses =
          participant_.writer(unitree_api_msg_dds__Response__desc, topic_of(service, "response").c_str(), kCallsKept);
    }
  }

  bool take(Service service, RpcRequest& request) override {
    if (of(service).requests == 0) return false;
    const Loan<RequestSample> loan(of(service).requests);
    const RequestSample* sample = loan.get();
    if (sample == nullptr) return false;
    request = read_request(sample->header.identity.id, static_cast<ServiceCall>(sample->header.identity.api_id));
    const std::size_t length = sample->parameter == nullptr ? 0 : std::strlen(sample->parameter);
    std::copy_n(sample->parameter, std::min(length, request.parameter.size() - 1), request.parameter.begin());
    return true;
  }
  void respond(Service service, const RpcResponse& response) override {
    ResponseSample sample{};
    sample.header.identity.id = response.id;
    sample.header.identity.api_id = response.api;
    sample.header.status.code = response.code;
    text_ = response.data;
    sample.data = text_.data();
    (void)dds_write(of(service).responses, &sample);
  }
  bool take_arms(LowCommandFrame& frame) override {
    ArmSample sample;
    if (!take_sample(arms_, sample)) return false;
    std::memcpy(&frame, &sample, sizeof(frame));
    return true;
  }

 private:
  struct Calls {
    dds_entity_t requests = 0, responses = 0;
  };
  Calls& of(Service service) { return calls_[static_cast<std::size_t>(service)]; }

  Participant participant_;
  dds_entity_t arms_;
  std::array<Calls, kServiceNames.size()> calls_{};
  std::string text_;
};

}  // namespace

std::unique_ptr<SportWire> open_sport_wire(const DdsPlace& place, std::span<const Service> services) {
  return std::make_unique<DdsSportWire>(place, services);
}

std::unique_ptr<ServicesWire> open_services(const DdsPlace& place, std::span<const Service> services) {
  check_twin_place(place);
  return std::make_unique<DdsServices>(place, services);
}

}  // namespace duet
