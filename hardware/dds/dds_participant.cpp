#include "duet/hardware/dds/dds_participant.h"

#include <fmt/format.h>

#include <array>
#include <stdexcept>

namespace duet {
namespace {

constexpr int kMostWriters = 64;

// Nothing but the interface: whether peers find each other by multicast is left to the library, which looks whether the
// interface has it, as it does for the maker's programs. Whoever decides otherwise is not found by them.
std::string configuration(const DdsPlace& place) {
  return fmt::format(
      "<CycloneDDS><Domain Id=\"any\"><General><Interfaces><NetworkInterface name=\"{}\"/></Interfaces></General>"
      "</Domain></CycloneDDS>",
      place.interface);
}

}  // namespace

dds_entity_t checked_entity(dds_entity_t entity, const char* what) {
  if (entity >= 0) return entity;
  throw std::runtime_error(fmt::format("DDS: {}: {}", what, dds_strretcode(-entity)));
}

Participant::Participant(const DdsPlace& place) {
  check_place(place);
  // In one process a domain has one configuration: where this process has made it before, it stands.
  domain_ = dds_create_domain(static_cast<dds_domainid_t>(place.domain), configuration(place).c_str());
  if (domain_ < 0 && domain_ != DDS_RETCODE_PRECONDITION_NOT_MET) checked_entity(domain_, "cannot make the domain");
  participant_ = dds_create_participant(static_cast<dds_domainid_t>(place.domain), nullptr, nullptr);
  if (participant_ < 0) {
    if (domain_ > 0) dds_delete(domain_);
    checked_entity(participant_, fmt::format("cannot use interface '{}'", place.interface).c_str());
  }
}

Participant::~Participant() {
  dds_delete(participant_);
  if (domain_ > 0) dds_delete(domain_);
}

// Best effort: a late state is worse than none.
dds_entity_t Participant::reader(const dds_topic_descriptor_t& type, const char* name, int kept) {
  return endpoint(type, name, true, kept);
}

dds_entity_t Participant::writer(const dds_topic_descriptor_t& type, const char* name, int kept) {
  return endpoint(type, name, false, kept);
}

dds_entity_t Participant::endpoint(const dds_topic_descriptor_t& type, const char* name, bool reads, int kept) {
  const dds_entity_t topic = checked_entity(dds_create_topic(participant_, &type, name, nullptr, nullptr), name);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, kept);
  dds_qset_reliability(qos, reads ? DDS_RELIABILITY_BEST_EFFORT : DDS_RELIABILITY_RELIABLE, DDS_MSECS(1));
  const dds_entity_t made = reads ? dds_create_reader(participant_, topic, qos, nullptr)
                                  : dds_create_writer(participant_, topic, qos, nullptr);
  dds_delete_qos(qos);
  return checked_entity(made, name);
}

WriterCount::WriterCount(const Participant& participant)
    : reader_(
          checked_entity(dds_create_reader(participant.entity(), DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr),
                         "cannot see who writes")) {
  checked_entity(dds_get_guid(participant.entity(), &self_), "cannot see who we are");
}

int WriterCount::of(const char* topic) {
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

bool DataWait::wait(dds_entity_t reader, double most) {
  if (set_ == 0) {
    set_ = checked_entity(dds_create_waitset(participant_), "cannot wait");
    checked_entity(dds_set_status_mask(reader, DDS_DATA_AVAILABLE_STATUS), "cannot wait for samples");
    checked_entity(dds_waitset_attach(set_, reader, 0), "cannot wait for samples");
  }
  return dds_waitset_wait(set_, nullptr, 0, static_cast<dds_duration_t>(most * 1e9)) > 0;
}

}  // namespace duet
