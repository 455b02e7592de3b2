// A neural network ready to be evaluated at batch 1: what a controller or a policy sees of a file. Knows nothing of
// what the network is for. Nothing allocates after load. One owner, not thread-safe: one network per thread.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

namespace duet {

// A named input or output, flattened in the file's (row-major) order.
struct Port {
  std::string name;
  int size = 0;
};

class Network {
 public:
  virtual ~Network() = default;
  [[nodiscard]] virtual std::span<const Port> inputs() const = 0;
  [[nodiscard]] virtual std::span<const Port> outputs() const = 0;
  // One evaluation; inputs and outputs in the order of inputs() and outputs(). Sizes must match (unchecked). A value
  // that is not finite is not caught here: it comes out as one (controllers/guard.h).
  virtual void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) = 0;
  // Clears a recurrent network's memory; others have none.
  virtual void reset() {}
};

// By content, not by name: ONNX, TorchScript of the kinds in nn/torch_script.h, safetensors of nn/mlp_file.h. Throws
// InputError (file, place, expected, found) for a file that is not readable, truncated, of another kind, with an
// operator or a shape that is not supported (by name), or with weights that are not finite. `engine`: "duet" (ours), or
// "libtorch" where it was built in (std::invalid_argument otherwise, naming those present).
std::unique_ptr<Network> load_network(const std::string& path, const std::string& engine = "duet");
std::vector<std::string> network_engines();

}  // namespace duet
