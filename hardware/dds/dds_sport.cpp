#include "duet/hardware/dds/dds_sport.h"

#include <algorithm>
#include <cstring>

#include "duet/hardware/dds/dds_participant.h"
#include "g1.h"

namespace duet {
namespace {

using ArmSample = unitree_hg_msg_dds__LowCmd_;
using RequestSample = unitree_api_msg_dds__Request_;
using ResponseSample = unitree_api_msg_dds__Response_;

constexpr const char* kArmTopic = "rt/arm_sdk";
constexpr const char* kRequestTopic = "rt/api/sport/request";
constexpr const char* kResponseTopic = "rt/api/sport/response";
constexpr int kCallsKept = 32;  // a call that is overwritten is lost

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
  explicit DdsSportWire(const DdsPlace& place)
      : participant_(place),
        responses_(participant_.reader(unitree_api_msg_dds__Response__desc, kResponseTopic, kCallsKept)),
        requests_(participant_.writer(unitree_api_msg_dds__Request__desc, kRequestTopic, kCallsKept)),
        others_(participant_) {}

  bool take(RpcResponse& response) override {
    const Loan<ResponseSample> loan(responses_);
    const ResponseSample* sample = loan.get();
    if (sample == nullptr) return false;
    response.id = sample->header.identity.id;
    response.api = sample->header.identity.api_id;
    response.code = sample->header.status.code;
    response.data = sample->data == nullptr ? "" : sample->data;
    return true;
  }
  bool request(const RpcRequest& request) override {
    RequestSample sample{};
    sample.header.identity.id = request.id;
    sample.header.identity.api_id = static_cast<std::int64_t>(request.call);
    parameter_ = request.parameter;
    sample.parameter = parameter_.data();
    return dds_write(requests_, &sample) == DDS_RETCODE_OK;
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
  Participant participant_;
  dds_entity_t responses_, requests_, arms_ = 0;
  WriterCount others_;
  std::array<char, 96> parameter_{};
};

class DdsSportService final : public SportServiceWire {
 public:
  explicit DdsSportService(const DdsPlace& place)
      : participant_(place),
        arms_(participant_.reader(unitree_hg_msg_dds__LowCmd__desc, kArmTopic)),
        requests_(participant_.reader(unitree_api_msg_dds__Request__desc, kRequestTopic, kCallsKept)),
        responses_(participant_.writer(unitree_api_msg_dds__Response__desc, kResponseTopic, kCallsKept)) {}

  bool take(RpcRequest& request) override {
    const Loan<RequestSample> loan(requests_);
    const RequestSample* sample = loan.get();
    if (sample == nullptr) return false;
    request = read_request(sample->header.identity.id, static_cast<SportCall>(sample->header.identity.api_id));
    const std::size_t length = sample->parameter == nullptr ? 0 : std::strlen(sample->parameter);
    std::copy_n(sample->parameter, std::min(length, request.parameter.size() - 1), request.parameter.begin());
    return true;
  }
  void respond(const RpcResponse& response) override {
    ResponseSample sample{};
    sample.header.identity.id = response.id;
    sample.header.identity.api_id = response.api;
    sample.header.status.code = response.code;
    text_ = response.data;
    sample.data = text_.data();
    (void)dds_write(responses_, &sample);
  }
  bool take_arms(LowCommandFrame& frame) override {
    ArmSample sample;
    if (!take_sample(arms_, sample)) return false;
    std::memcpy(&frame, &sample, sizeof(frame));
    return true;
  }

 private:
  Participant participant_;
  dds_entity_t arms_, requests_, responses_;
  std::string text_;
};

}  // namespace

std::unique_ptr<SportWire> open_sport_wire(const DdsPlace& place) { return std::make_unique<DdsSportWire>(place); }

std::unique_ptr<SportServiceWire> open_sport_service(const DdsPlace& place) {
  check_twin_place(place);
  return std::make_unique<DdsSportService>(place);
}

}  // namespace duet
