// Files of torch.save for tests.
#pragma once

#include <string>
#include <vector>

#include "duet/archives/zip/zip.h"
#include "tests/archives/pickle_bytes.h"

namespace duet::test {

class TorchWriter {
 public:
  PickleWriter pickle = PickleWriter(2);

  // A tensor over a storage of its own: `bytes` are its numbers as they lie in the file.
  TorchWriter& tensor(const std::string& storage, const std::string& bytes, int count, int first,
                      const std::vector<int>& sizes, const std::vector<int>& strides) {
    const std::string key = std::to_string(entries_.size());
    pickle.raw("ctorch._utils\n_rebuild_tensor_v2\n((").text("storage").raw("ctorch\n" + storage + "\n");
    pickle.text(key).text("cpu").integer(count).raw("tQ").integer(first).raw("(");
    for (const int size : sizes) pickle.integer(size);
    pickle.raw("t(");
    for (const int stride : strides) pickle.integer(stride);
    pickle.raw(
        "t\x89"
        "ccollections\nOrderedDict\n)RtR");
    entries_.push_back({"archive/data/" + key, bytes});
    return *this;
  }
  // Floats of shape (rows, columns), stored column by column where `transposed`.
  TorchWriter& floats(int rows, int columns, const std::vector<double>& values, bool transposed = false) {
    std::vector<double> stored = values;
    if (transposed)
      for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; ++c) stored[c * rows + r] = values[r * columns + c];
    const std::vector<int> strides = transposed ? std::vector<int>{1, rows} : std::vector<int>{columns, 1};
    return tensor("FloatStorage", PickleWriter::packed_floats(stored), rows * columns, 0, {rows, columns}, strides);
  }
  [[nodiscard]] std::string str() const {
    std::vector<ZipEntry> entries = {{"archive/data.pkl", pickle.str()}, {"archive/byteorder", "little"}};
    entries.insert(entries.end(), entries_.begin(), entries_.end());
    return zip_bytes(entries);
  }

 private:
  std::vector<ZipEntry> entries_;
};

}  // namespace duet::test
