#include "duet/core/synthetic_id.h"

#include <fmt/format.h>

namespace duet {

std::string synthetic_clip_id(std::string_view manner, std::string_view task, std::uint64_t seed, int index) {
  return fmt::format("{}-{}-s{}-{:04}", manner, task, seed, index);
}

}  // namespace duet
