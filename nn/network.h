// A neural network ready to be evaluated at batch 1: what a controller or a policy sees of a file. Knows nothing of
// what the network is for. Nothing allocates after load. One owner, not thread-safe: one network per thread.
#pragma once

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

}  // namespace duet
