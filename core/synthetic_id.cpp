#include "duet/core/synthetic_id.h"

#include <fmt/format.h>

namespace duet {

std::string synthetic_clip_id(std::string_view manner, std::string_view task, std::uint64_t seed, int index) {
  return fmt::format("{}-{}-s{}-{:04}", manner, task, seed, index);
}

std::string tracked_clip_id(const std::string& id) { return id + "-tracked"; }

std::string id_in_other_role(const std::string& id, char before) {
  const std::string own = before == 'A' ? "-A" : "-B", other = before == 'A' ? "-B" : "-A";
  return id.size() > own.size() && id.ends_with(own) ? id.substr(0, id.size() - own.size()) : id + other;
}

}  // namespace duet
