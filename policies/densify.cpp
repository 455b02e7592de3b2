#include "duet/policies/densify.h"

namespace duet {

std::vector<Reference> densify(const Anchors& anchors) {
  constexpr int kGrid = (kAnchors - 1) * kTicksPerAnchor;
  std::vector<Reference> dense;
  dense.reserve(kGrid);
  for (int i = 0; i < kGrid; ++i) {
    const Reference& a = anchors[static_cast<std::size_t>(i / kTicksPerAnchor)];
    const Reference& b = anchors[static_cast<std::size_t>(i / kTicksPerAnchor) + 1];
    const double s = static_cast<double>(i % kTicksPerAnchor) / kTicksPerAnchor;
    dense.push_back(interpolate(a, b, s));
  }
  return dense;
}

Reference interpolate(const Reference& a, const Reference& b, double s) {
  if (s == 0.0) return a;  // exactly: slerp rounds
  return {interpolate(a.X_WB, b.X_WB, s), a.q + s * (b.q - a.q)};
}

}  // namespace duet
