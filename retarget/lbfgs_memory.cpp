#include "duet/retarget/lbfgs_memory.h"

#include <array>

namespace duet {

namespace {
constexpr double kLeastCurvature = 1e-8;  // s.y over |s| |y|
}  // namespace

bool LbfgsMemory::keep() {
  const int s = next_slot(), y = s + 1;
  const double curvature = product(s, y);
  if (!(curvature > kLeastCurvature * std::sqrt(product(s, s) * product(y, y)))) return false;
  ++stored_;
  return true;
}

Eigen::VectorXd LbfgsMemory::direction() const {
  Eigen::VectorXd factor = Eigen::VectorXd::Zero(kGradient + 1);
  factor[kGradient] = 1.0;
  const auto times = [&](int slot) { return gram_.row(slot).dot(factor); };
  std::array<double, kPairs> alpha{};
  for (int k = 0; k < pairs(); ++k) {  // from the newest back
    const int s = 2 * ((stored_ - 1 - k) % kPairs);
    alpha[k] = times(s) / product(s, s + 1);
    factor[s + 1] -= alpha[k];
  }
  if (stored_ > 0) {
    const int s = 2 * ((stored_ - 1) % kPairs);
    factor *= product(s, s + 1) / product(s + 1, s + 1);
  }
  for (int k = pairs() - 1; k >= 0; --k) {
    const int s = 2 * ((stored_ - 1 - k) % kPairs);
    factor[s] += alpha[k] - times(s + 1) / product(s, s + 1);
  }
  return -factor;
}

}  // namespace duet
