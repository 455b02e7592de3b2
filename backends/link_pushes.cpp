#include "duet/backends/link_pushes.h"

#include <algorithm>

namespace duet {

void LinkPushes::clear() {
  std::fill(pushes_.begin(), pushes_.end(), Push{});
  any_ = false;
}

void LinkPushes::set(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_L) {
  pushes_[link] = {f_W, p_L};
  any_ = true;
}

void LinkPushes::append_to(std::vector<double>& values) const {
  values.push_back(any_ ? 1.0 : 0.0);
  for (const Push& push : pushes_) {
    values.insert(values.end(), push.f_W.data(), push.f_W.data() + 3);
    values.insert(values.end(), push.p_L.data(), push.p_L.data() + 3);
  }
}

void LinkPushes::read_from(std::span<const double> values) {
  any_ = values[0] != 0.0;
  const double* from = values.data() + 1;
  for (Push& push : pushes_) {
    push = {Eigen::Vector3d(from), Eigen::Vector3d(from + 3)};
    from += 6;
  }
}

}  // namespace duet
