// The forces of Backend::push: each keeps its direction in W and acts at a point fixed to its link.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace duet {

class LinkPushes {
 public:
  struct Push {
    Eigen::Vector3d f_W = Eigen::Vector3d::Zero();
    Eigen::Vector3d p_L = Eigen::Vector3d::Zero();
  };

  explicit LinkPushes(std::size_t links) : pushes_(links) {}

  void clear();
  void set(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_L);
  [[nodiscard]] bool any() const { return any_; }
  [[nodiscard]] std::span<const Push> all() const { return pushes_; }  // one per link

  // For snapshots: size() numbers, appended or read back.
  [[nodiscard]] std::size_t size() const { return 1 + 6 * pushes_.size(); }
  void append_to(std::vector<double>& values) const;
  void read_from(std::span<const double> values);

 private:
  std::vector<Push> pushes_;
  bool any_ = false;  // since the last clear
};

}  // namespace duet
