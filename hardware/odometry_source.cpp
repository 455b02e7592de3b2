#include "duet/hardware/odometry_source.h"

#include <bit>
#include <cmath>
#include <cstring>

namespace duet {
namespace {

constexpr std::uint32_t kExternalVersion = 0x31504F44;  // "DOP1"
constexpr int kMostExternal = 32;                       // of a tick
constexpr double kUnit = 0.01;

struct ExternalBody {
  std::uint32_t version, valid;
  std::uint64_t sequence;
  double position[3], quat_wxyz[4], velocity[3];
  std::uint64_t reserved;
};
static_assert(sizeof(ExternalBody) == kExternalPoseBytes && std::endian::native == std::endian::little);

bool all_finite(const ExternalBody& body) {
  for (const double value : body.position)
    if (!std::isfinite(value)) return false;
  for (const double value : body.quat_wxyz)
    if (!std::isfinite(value)) return false;
  for (const double value : body.velocity)
    if (!std::isfinite(value)) return false;
  return true;
}

}  // namespace

void encode(const ExternalPose& pose, ExternalPoseBuffer& buffer) {
  const Eigen::Quaterniond& R = pose.X_WB.R;
  const Eigen::Vector3d& p = pose.X_WB.p;
  const Eigen::Vector3d& v = pose.v_WB;
  const ExternalBody body{kExternalVersion,
                          pose.valid ? 1u : 0u,
                          pose.sequence,
                          {p.x(), p.y(), p.z()},
                          {R.w(), R.x(), R.y(), R.z()},
                          {v.x(), v.y(), v.z()},
                          0};
  std::memcpy(buffer.data(), &body, sizeof(body));
}

bool decode(std::span<const std::byte> datagram, ExternalPose& pose) {
  ExternalBody body;
  if (datagram.size() != sizeof(body)) return false;
  std::memcpy(&body, datagram.data(), sizeof(body));
  const Eigen::Quaterniond R(body.quat_wxyz[0], body.quat_wxyz[1], body.quat_wxyz[2], body.quat_wxyz[3]);
  if (body.version != kExternalVersion || body.valid > 1 || !all_finite(body) || !(std::abs(R.norm() - 1.0) < kUnit))
    return false;
  pose.sequence = body.sequence;
  pose.X_WB = {R.normalized(), {body.position[0], body.position[1], body.position[2]}};
  pose.v_WB = {body.velocity[0], body.velocity[1], body.velocity[2]};
  pose.valid = body.valid == 1;
  return true;
}

bool ExternalOdometry::take(OdometrySample& sample) {
  std::array<std::byte, kExternalPoseBytes + 1> buffer;  // a longer one is refused
  ExternalPose pose;
  bool took = false;
  for (int k = 0; k < kMostExternal; ++k) {
    const std::size_t size = socket_.receive(buffer);
    if (size == 0) break;
    if (!decode(std::span<const std::byte>(buffer).first(size), pose)) {
      ++refused_;
      continue;
    }
    if (!order_.takes(pose.sequence, clock_())) continue;
    took = true;
    sample.sender_restarts = order_.restarts();
    sample.X_WB = pose.X_WB;
    sample.v_WB = pose.v_WB;
    sample.valid = pose.valid;
  }
  return took;
}

}  // namespace duet
