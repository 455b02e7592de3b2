#include "duet/replay/replay_columns.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kMostSteps = 32767.0;  // to either side of a column's middle
constexpr std::int16_t kNotANumber = INT16_MIN;

struct ColumnScale {
  double base = 0.0, step = 1.0;
};

ColumnScale scale_of(const Eigen::Ref<const Eigen::VectorXd>& column, double step) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : column) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (low > high) return {0.0, step};
  const double base = low + (high - low) / 2.0;
  return {base, std::max(step, (high - low) / (2.0 * kMostSteps))};
}

std::int16_t quantised(double value, const ColumnScale& scale) {
  if (!std::isfinite(value)) return kNotANumber;
  return static_cast<std::int16_t>(std::lround(std::clamp((value - scale.base) / scale.step, -kMostSteps, kMostSteps)));
}

}  // namespace

nlohmann::json ReplayColumns::add(const Eigen::Ref<const Eigen::MatrixXd>& values, double step) {
  require(step > 0.0, "replay columns: expected a positive step");
  const auto rows = static_cast<std::size_t>(values.rows()), size = rows * static_cast<std::size_t>(values.cols());
  nlohmann::json bases = nlohmann::json::array(), steps = nlohmann::json::array();
  const std::size_t at = bytes_.size();
  bytes_.resize(at + 2 * size);  // the low bytes of all values, then the high ones
  for (Eigen::Index k = 0; k < values.cols(); ++k) {
    const ColumnScale scale = scale_of(values.col(k), step);
    bases.push_back(scale.base);
    steps.push_back(scale.step);
    std::uint16_t before = 0, before_that = 0;
    for (std::size_t t = 0; t < rows; ++t) {
      const auto value = static_cast<std::uint16_t>(quantised(values(static_cast<Eigen::Index>(t), k), scale));
      const auto second = static_cast<std::uint16_t>(value - 2 * before + before_that);  // modulo 65536
      const std::size_t place = at + static_cast<std::size_t>(k) * rows + t;
      bytes_[place] = static_cast<char>(second & 0xff);
      bytes_[place + size] = static_cast<char>(second >> 8);
      before_that = before;
      before = value;
    }
  }
  return {{"at", at}, {"rows", rows}, {"bases", std::move(bases)}, {"steps", std::move(steps)}};
}

}  // namespace duet
