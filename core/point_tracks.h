// Points over time, (T, K, 3) in [m], frame W, stored contiguously in that order (as NumPy would).
#pragma once

#include <Eigen/Core>
#include <vector>

namespace duet {

class PointTracks {
 public:
  using Frame = Eigen::Map<Eigen::Matrix3Xd>;
  using ConstFrame = Eigen::Map<const Eigen::Matrix3Xd>;

  PointTracks() = default;
  // All zero. Throws std::invalid_argument for negative sizes.
  PointTracks(int frames, int points);
  // Takes (T, K, 3) data; throws std::invalid_argument where the size is not frames * points * 3.
  PointTracks(int frames, int points, std::vector<double> data);

  [[nodiscard]] int frames() const { return frames_; }
  [[nodiscard]] int points() const { return points_; }
  [[nodiscard]] bool empty() const { return data_.empty(); }
  [[nodiscard]] const std::vector<double>& data() const { return data_; }
  [[nodiscard]] std::vector<double>& data() { return data_; }

  // The K points of frame t as the columns of a 3 x K matrix. No range check.
  [[nodiscard]] Frame frame(int t) { return {data_.data() + offset(t, 0), 3, points_}; }
  [[nodiscard]] ConstFrame frame(int t) const { return {data_.data() + offset(t, 0), 3, points_}; }
  // One point at one time. No range check.
  [[nodiscard]] Eigen::Map<Eigen::Vector3d> at(int t, int k) {
    return Eigen::Map<Eigen::Vector3d>(&data_[offset(t, k)]);
  }
  [[nodiscard]] Eigen::Map<const Eigen::Vector3d> at(int t, int k) const {
    return Eigen::Map<const Eigen::Vector3d>(&data_[offset(t, k)]);
  }

  // The tracks of the chosen points, in the order given. Throws std::invalid_argument for an index out of range.
  [[nodiscard]] PointTracks select(const std::vector<int>& points) const;
  // Frames [begin, end). Throws std::invalid_argument where they are not inside.
  [[nodiscard]] PointTracks slice(int begin, int end) const;

  bool operator==(const PointTracks&) const = default;

 private:
  [[nodiscard]] size_t offset(int t, int k) const { return 3 * (static_cast<size_t>(t) * points_ + k); }

  int frames_ = 0;
  int points_ = 0;
  std::vector<double> data_;
};

}  // namespace duet
