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
  // that is not finite is not caught here: it comes out as one (controllers/controller.h).
  virtual void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) = 0;
  // Clears a recurrent network's memory; others have none.
  virtual void reset() {}
};

// Evaluation by a library that a build may lack: one source is compiled where the library was found and one that says
// so otherwise; the vendor's header appears only there. Internal to nn/.

bool libtorch_built_in();

// A network from a file's bytes; `path` is for messages. Throws InputError as load_network does; MissingError where the
// library is not built in.
std::unique_ptr<Network> libtorch_network(const std::string& bytes, const std::string& path);

}  // namespace duet
