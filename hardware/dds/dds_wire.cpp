#include "duet/hardware/dds/dds_wire.h"

#include <dds/dds.h>
#include <fmt/format.h>

#include <array>
#include <cstring>
#include <span>

#include "duet/core/digest.h"
#include "duet/core/require.h"
#include "g1.h"

namespace duet {
namespace {

using CommandSample = unitree_hg_msg_dds__LowCmd_;
using StateSample = unitree_hg_msg_dds__LowState_;
using OdometryMessage = unitree_go_msg_dds__SportModeState_;
static_assert(sizeof(CommandSample) == sizeof(LowCommandFrame) && sizeof(StateSample) == sizeof(LowStateFrame));

constexpr const char* kCommandTopic = "rt/lowcmd";
constexpr const char* kStateTopic = "rt/lowstate";
constexpr const char* kOdometryTopic = "rt/odommodestate";
constexpr int kMostWriters = 64;

dds_entity_t checked(dds_entity_t entity, const char* what) {
  if (entity >= 0) return entity;
  throw std::runtime_error(fmt::format("DDS: {}: {}", what, dds_strretcode(-entity)));
}

std::string configuration(const DdsPlace& place) {
  return fmt::format(
      "<CycloneDDS><Domain Id=\"any\"><General><Interfaces><NetworkInterface name=\"{}\"{}/></Interfaces></General>"
      "</Domain></CycloneDDS>",
      place.interface, place.interface == "lo" ? " multicast=\"false\"" : "");
}

// The participant, and the domain that it configured itself. Deleting them deletes everything that hangs on them.
class Participant {
 public:
  explicit Participant(const DdsPlace& place) {
    check_place(place);
    // In one process a domain has one configuration: where this process has made it before, it stands.
    domain_ = dds_create_domain(static_cast<dds_domainid_t>(place.domain), configuration(place).c_str());
    if (domain_ < 0 && domain_ != DDS_RETCODE_PRECONDITION_NOT_MET) checked(domain_, "cannot make the domain");
    participant_ = dds_create_participant(static_cast<dds_domainid_t>(place.domain), nullptr, nullptr);
    if (participant_ < 0) {
      if (domain_ > 0) dds_delete(domain_);
      checked(participant_, fmt::format("cannot use interface '{}'", place.interface).c_str());
    }
  }
  ~Participant() {
    dds_delete(participant_);
    if (domain_ > 0) dds_delete(domain_);
  }
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  dds_entity_t reader(const dds_topic_descriptor_t& type, const char* name) {
    return endpoint(type, name, DDS_RELIABILITY_BEST_EFFORT, true);
  }
  dds_entity_t writer(const dds_topic_descriptor_t& type, const char* name) {
    return endpoint(type, name, DDS_RELIABILITY_RELIABLE, false);
  }
  [[nodiscard]] dds_entity_t entity() const { return participant_; }

 private:
  dds_entity_t endpoint(const dds_topic_descriptor_t& type, const char* name, dds_reliability_kind_t reliability,
                        bool reads) {
    const dds_entity_t topic = checked(dds_create_topic(participant_, &type, name, nullptr, nullptr), name);
    dds_qos_t* qos = dds_create_qos();
    dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
    dds_qset_reliability(qos, reliability, DDS_MSECS(1));
    const dds_entity_t made = reads ? dds_create_reader(participant_, topic, qos, nullptr)
                                    : dds_create_writer(participant_, topic, qos, nullptr);
    dds_delete_qos(qos);
    return checked(made, name);
  }

  dds_entity_t domain_ = 0, participant_ = 0;
};

// The newest sample, into memory of our own. Padding is inside the checksums: it is 0 unless something else came.
template <typename Sample>
bool take_sample(dds_entity_t reader, Sample& sample) {
  std::memset(&sample, 0, sizeof(sample));
  void* place = &sample;
  dds_sample_info_t info;
  return dds_take(reader, &place, &info, 1, 1) > 0 && info.valid_data;
}

// Those who write a topic now, but the participant itself.
class WriterCount {
 public:
  explicit WriterCount(const Participant& participant)
      : reader_(checked(dds_create_reader(participant.entity(), DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr),
                        "cannot see who writes")) {
    checked(dds_get_guid(participant.entity(), &self_), "cannot see who we are");
  }
  int of(const char* topic) {
    std::array<void*, kMostWriters> samples{};
    std::array<dds_sample_info_t, kMostWriters> infos;
    const int found = dds_read(reader_, samples.data(), infos.data(), kMostWriters, kMostWriters);
    int writers = 0;
    for (int k = 0; k < found; ++k) {
      if (!infos[k].valid_data || infos[k].instance_state != DDS_IST_ALIVE) continue;
      const auto* endpoint = static_cast<const dds_builtintopic_endpoint_t*>(samples[k]);
      const bool own = std::memcmp(endpoint->participant_key.v, self_.v, sizeof(self_.v)) == 0;
      writers += !own && std::strcmp(endpoint->topic_name, topic) == 0 ? 1 : 0;
    }
    if (found > 0) dds_return_loan(reader_, samples.data(), found);
    return writers;
  }

 private:
  dds_entity_t reader_;
  dds_guid_t self_{};
};

class DdsRobotWire final : public RobotWire {
 public:
  explicit DdsRobotWire(const DdsPlace& place)
      : participant_(place),
        states_(participant_.reader(unitree_hg_msg_dds__LowState__desc, kStateTopic)),
        odometry_(participant_.reader(unitree_go_msg_dds__SportModeState__desc, kOdometryTopic)),
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
  dds_entity_t states_, odometry_, writer_ = 0;
  WriterCount others_;
};

class DdsTwinWire final : public TwinWire {
 public:
  explicit DdsTwinWire(const DdsPlace& place)
      : participant_(place),
        commands_(participant_.reader(unitree_hg_msg_dds__LowCmd__desc, kCommandTopic)),
        states_(participant_.writer(unitree_hg_msg_dds__LowState__desc, kStateTopic)),
        odometry_(participant_.writer(unitree_go_msg_dds__SportModeState__desc, kOdometryTopic)),
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
  int command_writers() override { return others_.of(kCommandTopic); }

 private:
  Participant participant_;
  dds_entity_t commands_, states_, odometry_;
  WriterCount others_;
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
        &unitree_go_msg_dds__SportModeState__desc}) {
    if (type != known->m_typename) continue;
    Sha256 digest;
    digest.update(std::as_bytes(std::span(known->type_information.data, known->type_information.sz)));
    digest.update(std::as_bytes(std::span(known->type_mapping.data, known->type_mapping.sz)));
    return digest.hex();
  }
  throw std::invalid_argument(fmt::format("DDS: expected a type of the G1, found '{}'", type));
}

}  // namespace duet
