// The participant that every user of DDS here shares: one, in one domain on one named interface, with the quality of
// service that hardware/dds/dds_wire.h tells of. Only in this folder. One owner, one thread.
#pragma once

#include <dds/dds.h>

#include <cstring>

#include "duet/hardware/wire/robot_wire.h"

namespace duet {

// Throws std::runtime_error "DDS: WHAT: REASON" for an entity that was not made.
dds_entity_t checked_entity(dds_entity_t entity, const char* what);

// The participant, and the domain that it configured itself. Deleting them deletes everything that hangs on them.
class Participant {
 public:
  explicit Participant(const DdsPlace& place);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  // `kept`: how many samples wait to be taken.
  dds_entity_t reader(const dds_topic_descriptor_t& type, const char* name, int kept = 1);
  dds_entity_t writer(const dds_topic_descriptor_t& type, const char* name, int kept = 1);
  [[nodiscard]] dds_entity_t entity() const { return participant_; }

 private:
  dds_entity_t endpoint(const dds_topic_descriptor_t& type, const char* name, bool reads, int kept);

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
  explicit WriterCount(const Participant& participant);
  int of(const char* topic);

 private:
  dds_entity_t reader_;
  dds_guid_t self_{};
};

// Waits for samples of one reader.
class DataWait {
 public:
  explicit DataWait(dds_entity_t participant) : participant_(participant) {}
  // True as soon as one can be taken, false after `most` [s].
  bool wait(dds_entity_t reader, double most);

 private:
  dds_entity_t participant_, set_ = 0;
};

}  // namespace duet
