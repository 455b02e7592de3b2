// Recorded estimates of one person: the messages of an estimator (hardware/guard/person_input.h), of either form, one
// after another in a file; their times are the sender's. What one of them says may be refused, as at the socket.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/hardware/guard/person_input.h"

namespace duet {

struct RecordedEstimate {
  double at = 0.0;    // of its message, after the first one's [s]
  std::string bytes;  // it, of 600 or 608 bytes
};

// Throws InputError naming the message: nothing there, no such message, one that is cut off, a clock that falls or is
// a day away.
std::vector<RecordedEstimate> parse_person_log(std::string_view bytes, const std::string& name);
std::vector<RecordedEstimate> read_person_log(const std::string& path);
// The message as it would be recorded, at its stamp.
RecordedEstimate recorded(const PersonEstimate& estimate);
std::string person_log(std::span<const RecordedEstimate> estimates);

// The fate of each by itself, without an order among them.
PersonCounts counts_of(std::span<const RecordedEstimate> estimates);

}  // namespace duet
