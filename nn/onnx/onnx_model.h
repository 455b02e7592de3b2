// The content of an ONNX file, free of protobuf: a graph of named nodes, its constants and its ports. Nothing is
// evaluated here. Thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace duet {

using Shape = std::vector<std::int64_t>;

enum class ElementType { kFloat, kInteger, kBoolean };

// Floating-point types of any width come as float, integers and booleans of any width as int64.
struct OnnxTensor {
  ElementType type = ElementType::kFloat;
  Shape shape;
  std::vector<float> floats;           // of kFloat
  std::vector<std::int64_t> integers;  // of the others
};

using OnnxAttribute = std::variant<std::int64_t, float, std::string, std::vector<std::int64_t>, std::vector<float>,
                                   std::vector<std::string>, OnnxTensor>;

struct OnnxNode {
  std::string name;  // never empty: "Gemm#3" where the file gives none
  std::string op;    // with its domain in front where that is not ONNX's own: "com.microsoft.FusedGemm"
  std::vector<std::string> inputs, outputs;  // "" where one is left out
  std::map<std::string, OnnxAttribute> attributes;
};

struct OnnxPort {
  std::string name;
  Shape shape;  // -1: not fixed by the file; empty also where the file gives none
};

struct OnnxGraph {
  std::string file;
  int opset = 0;
  std::vector<OnnxPort> inputs;  // without those that are constants; float
  std::vector<OnnxPort> outputs;
  std::map<std::string, OnnxTensor> constants;
  std::vector<OnnxNode> nodes;                    // each after those whose outputs it reads
  std::map<std::string, std::string> metadata{};  // what the file says of itself, by key
};

inline constexpr int kOldestOpset = 11, kNewestOpset = 18;

// `folder`: where files lie that the model keeps numbers in (nn/onnx/onnx_model.h); "": it may have none. Throws
// InputError naming file, place, expected and found: not an ONNX model or truncated, an operator set outside
// [kOldestOpset, kNewestOpset], constants in other files that are not there, too short or elsewhere, of an unknown
// type, of a wrong number of bytes, or not finite (a single number may be infinite: a bound of Clip).
OnnxGraph parse_onnx(std::string_view bytes, const std::string& file, const std::string& folder = "");

// Where a model keeps numbers outside of its own file, as it says so; none for bytes that are no model.
std::set<std::string> external_locations(std::string_view bytes);

// Numbers of an ONNX file that lie in files beside it ("external data"). A model comes from others: it names files of
// its own folder alone. Internal to nn/.

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
