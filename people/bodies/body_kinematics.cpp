#include "duet/people/bodies/body_kinematics.h"

#include <array>
#include <cmath>

namespace duet {
namespace {

// 1/(2n)! and 1/(2n+1)!, signs alternating: cos x and sin(x)/x as polynomials of x^2. Up to x = pi/2 (a turn of pi) the
// first term that is left out is below 1e-17.
constexpr int kTerms = 12;
constexpr double kLargestSquare = 2.4675;  // (pi/2)^2, rounded up

constexpr std::array<double, kTerms> series(int first) {
  std::array<double, kTerms> terms{};
  double factorial = 1.0;
  for (int n = 0, k = 1; n < kTerms; ++n) {
    for (; k <= 2 * n + first; ++k) factorial *= k;
    terms[n] = (n % 2 == 0 ? 1.0 : -1.0) / factorial;
  }
  return terms;
}
constexpr std::array<double, kTerms> kCosine = series(0), kSineOverX = series(1);

}  // namespace

Eigen::Quaterniond rotation_of_vector(const Eigen::Vector3d& axis_angle) {
  const double square = 0.25 * axis_angle.squaredNorm();  // of half the angle
  if (!(square <= kLargestSquare)) {
    const double angle = axis_angle.norm();
    const Eigen::Vector3d sine = std::sin(0.5 * angle) / angle * axis_angle;
    return {std::cos(0.5 * angle), sine.x(), sine.y(), sine.z()};
  }
  double cosine = kCosine[kTerms - 1], ratio = kSineOverX[kTerms - 1];
  for (int n = kTerms - 2; n >= 0; --n) {
    cosine = cosine * square + kCosine[n];
    ratio = ratio * square + kSineOverX[n];
  }
  ratio *= 0.5;
  return {cosine, ratio * axis_angle.x(), ratio * axis_angle.y(), ratio * axis_angle.z()};
}

void pose_body(const RestJoints& rest, const Eigen::Vector3d& translation, std::span<Eigen::Quaterniond> rotations,
               PointTracks::Frame joints) {
  joints.col(kPelvis) = rest.col(kPelvis) + translation;
  for (int j = 1; j < kSmplJoints; ++j) {
    const int parent = kSmplParents[j];  // comes before j
    joints.col(j) = joints.col(parent) + rotations[parent] * (rest.col(j) - rest.col(parent));
    rotations[j] = rotations[parent] * rotations[j];
  }
}

}  // namespace duet
