// Stands for nn/onnxruntime_network.cpp where ONNX Runtime was not found.
#include "core/require.h"
#include "nn/network_engines.h"

namespace duet {

bool onnxruntime_built_in() { return false; }

std::unique_ptr<Network> onnxruntime_network(const std::string& path) {
  throw MissingError("cannot read '" + path + "': this build has no ONNX Runtime");
}

}  // namespace duet
