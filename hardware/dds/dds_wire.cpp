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
static_assert(sizeof(CommandSample) == sizeof(LowCommandFrame) && sizeof(StateSample) == sizeof(LowStateFrame));

constexpr const char* kCommandTopic = "rt/lowcmd";
constexpr const char* kStateTopic = "rt/lowstate";
constexpr const char* kOdometryTopic = "rt/odommodestate";
constexpr const char* kBatteryTopic = "rt/lf/bmsstate";

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
  int command_writers() override { return others_.of(kCommandTopic); }
  bool wait(double most) override { return commands_wait_.wait(commands_, most); }

 private:
  Participant participant_;
  dds_entity_t commands_, states_, odometry_, battery_;
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
        &unitree_go_msg_dds__SportModeState__desc, &unitree_hg_msg_dds__BmsState__desc,
        &unitree_api_msg_dds__Request__desc, &unitree_api_msg_dds__Response__desc}) {
    if (type != known->m_typename) continue;
    Sha256 digest;
    digest.update(std::as_bytes(std::span(known->type_information.data, known->type_information.sz)));
    digest.update(std::as_bytes(std::span(known->type_mapping.data, known->type_mapping.sz)));
    return digest.hex();
  }
  throw std::invalid_argument(fmt::format("DDS: expected a type of the G1, found '{}'", type));
}

}  // namespace duet
