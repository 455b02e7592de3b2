// The summary of a worker's work.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "duet/experiment/work/stop_sign.h"

namespace duet {

struct WorkSummary {
  std::int64_t planned = 0, already_there = 0, run = 0;
  std::map<std::string, int> outcomes;  // of those run now
  std::string first_error = {};         // which episode and what it says; "" where none of them ended so
  std::int64_t poisoned = 0;            // of these: rows of episodes that killed their workers
  RunEnd end = RunEnd::kComplete;
  int exit_code = 0;  // of a training: of `duet train`
};

}  // namespace duet
