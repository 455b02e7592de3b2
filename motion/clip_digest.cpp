#include "duet/motion/clip_digest.h"

#include <cmath>
#include <cstdint>

#include "duet/core/digest.h"

namespace duet {
namespace {

void add(const PointTracks& joints, Sha256& digest) {
  std::vector<std::int32_t> tenths;
  tenths.reserve(joints.data().size());
  for (const double x : joints.data()) tenths.push_back(static_cast<std::int32_t>(std::lround(1e4 * x)));
  digest.update(std::string_view(reinterpret_cast<const char*>(tenths.data()), 4 * tenths.size()));
}

}  // namespace

std::string clip_digest(const PairedMotion& motion) {
  Sha256 digest;
  digest.update(std::string(to_string(motion.task)));
  const std::int32_t phases[] = {motion.phases.act_begin, motion.phases.act_end};
  digest.update(std::string_view(reinterpret_cast<const char*>(phases), sizeof phases));
  add(motion.source_partner.joints, digest);
  add(motion.source_reactor.joints, digest);
  if (!motion.object.empty()) add(keypoint_tracks(motion.object), digest);
  return digest.hex();
}

}  // namespace duet
