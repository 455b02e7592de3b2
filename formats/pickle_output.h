// Writes dicts of NumPy arrays, numbers and strings as a pickle of protocol 4: a fixed stream of opcodes that Python's
// pickle (and joblib) loads, and archives/pickle/pickle_machine.h reads.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

// A stream under construction: begin_dict(), then key(), value, key(), value, ..., end_dict(), finish().
class PickleOutput {
 public:
  PickleOutput();
  PickleOutput& begin_dict();
  PickleOutput& end_dict();
  PickleOutput& key(std::string_view name) { return text(name); }
  PickleOutput& text(std::string_view value);
  PickleOutput& real(double value);
  PickleOutput& rate(double rate_hz);                        // an integer where it is one
  PickleOutput& texts(std::span<const std::string> values);  // a list
  // Values row by row, as numpy.ndarray of float64. Throws std::invalid_argument where shape and values disagree.
  PickleOutput& array(const std::vector<std::size_t>& shape, std::span<const double> values);
  PickleOutput& array(const std::vector<std::size_t>& shape, const Eigen::MatrixXd& rows_as_columns) {
    return array(shape, std::span(rows_as_columns.data(), static_cast<std::size_t>(rows_as_columns.size())));
  }
  [[nodiscard]] std::string finish();

 private:
  PickleOutput& little(std::uint64_t value, int size);
  PickleOutput& integer(std::int64_t value);
  PickleOutput& call(std::string_view module, std::string_view name);
  PickleOutput& bytes(std::string_view value);

  std::string out_;
};

}  // namespace duet
