// Numbers of an ONNX file that lie in files beside it ("external data"). A model comes from others: it names files of
// its own folder alone. Internal to nn/.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>

namespace duet {

struct ExternalPlace {
  std::string location;                // of the file, from the model's folder
  std::int64_t offset = 0;             // [bytes]
  std::optional<std::int64_t> length;  // [bytes]; to the end of the file where none is given
};

inline constexpr std::int64_t kMostExternalBytes = std::int64_t{1} << 30;  // of one tensor

// The fault of a location, as the end of a sentence; empty where there is none: it is relative, without "..", and
// leads, links followed, to a file of `folder` or below it.
std::string location_fault(const std::string& folder, const std::string& location);

// The files of one model's folder, each read once and whole, so that its digest is of what was used. Not thread-safe.
class ExternalData {
 public:
  explicit ExternalData(std::string folder) : folder_(std::move(folder)) {}
  [[nodiscard]] const std::string& folder() const { return folder_; }
  // The bytes at that place. Throws InputError beginning with `where` ("'net.onnx': constant 'W'"): a location with a
  // fault, a file that is not there or shorter than is said, a tensor of more than kMostExternalBytes.
  std::string read(const ExternalPlace& place, const std::string& where);

 private:
  std::string folder_;
  std::map<std::string, std::string> files_;  // by location
};

}  // namespace duet
