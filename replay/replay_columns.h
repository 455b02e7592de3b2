// The numbers of a replay page: blocks of columns over time, quantised to 16 bits and stored as second differences,
// which a deflater makes small. viewer/src/columns.ts reads them; docs/file-formats.md ("Replay page") has the layout.
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <string>

namespace duet {

class ReplayColumns {
 public:
  // A block of K columns of T values each; `values` is (T, K). A value is kept to half of `step`, or, in a column whose
  // range is more than 65,534 steps, to half of that part of its range; what is not finite stays so (as NaN). Returns
  // what the page's header says of it. Throws std::invalid_argument for a step that is not positive.
  nlohmann::json add(const Eigen::Ref<const Eigen::MatrixXd>& values, double step);

  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

}  // namespace duet
